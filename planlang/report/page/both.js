// Two runs on one clock: what one page shows, the other shows at the same time; a run that is over stays at its end.

const frames = [...document.querySelectorAll("iframe")];
let loaded = 0;
addEventListener("message", (event) => {
  const from = frames.findIndex((one) => one.contentWindow === event.source);
  if (loaded < frames.length || from < 0 || !Number.isFinite(event.data?.time)) return;
  frames[1 - from].contentWindow.postMessage({ time: event.data.time }, "*");
});
function begin() {
  loaded += 1;
  if (loaded < frames.length) return;
  const time = JSON.parse(document.getElementById("time").textContent);
  for (const one of frames) one.contentWindow.postMessage({ time }, "*");
}
for (const one of frames) {
  if (one.contentDocument?.readyState === "complete" && one.contentDocument.body?.childElementCount) begin();
  else one.addEventListener("load", begin, { once: true });
}
