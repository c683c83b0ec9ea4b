// Poses over time from the compressed blob: 16-bit differences between keys, where something moved (docs/guides/report.md).

const unpacked = (name, format) => inflated(byId(`blob-${name}`).textContent, format);

async function inflated(text, format) {
  const bytes = Uint8Array.from(atob(text), (sign) => sign.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream(format));
  return new Response(stream).arrayBuffer();
}

const world = { entities: [], byName: new Map(), ready: false };

function readTracks(buffer) {
  const { entities, scale, period } = model.scene, total = entities.reduce((sum, one) => sum + one.keys, 0);
  const steps = new Int32Array(buffer, 0, total), numbers = new Int16Array(buffer, total * 4, total * 7);
  let first = 0;
  world.entities = entities.map((one) => {
    const { keys } = one, times = new Float64Array(keys), poses = new Float32Array(keys * 7);
    let step = 0;
    for (let k = 0; k < keys; k++) { step += steps[first + k]; times[k] = step / model.rate; }
    for (let column = 0; column < 7; column++) {
      let value = 0;
      for (let k = 0; k < keys; k++) {
        value = (value + numbers[column * total + first + k]) << 16 >> 16;
        poses[k * 7 + column] = column < 3 ? value * scale : value / 32767;
      }
    }
    first += keys;
    return { ...one, times, poses };
  });
  world.period = period;
  world.byName.clear();
  for (const one of world.entities) if (one.kind !== "belief") world.byName.set(one.name, one);
  world.ready = true;
}

// Pose (x, y, z, qx, qy, qz, qw) of an entity in its frame at a time; null while it does not exist.
function poseAt(entity, time, out = new Float32Array(7)) {
  const { times, poses } = entity;
  let low = 0, high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time + 1e-6) low = middle + 1; else high = middle;
  }
  const now = low - 1;
  if (now < 0 || isGone(entity, time)) return null;
  const next = now + 1 < times.length ? now + 1 : now;
  const begin = Math.max(times[now], times[next] - world.period);
  const share = next === now || time <= begin ? 0 : (time - begin) / (times[next] - begin);
  let length = 0;
  for (let k = 0; k < 7; k++) {
    out[k] = poses[now * 7 + k] * (1 - share) + poses[next * 7 + k] * share;
    if (k > 2) length += out[k] * out[k];
  }
  length = Math.sqrt(length) || 1;
  for (let k = 3; k < 7; k++) out[k] /= length;
  return out;
}

function isGone(entity, time) {
  let gone = false;
  for (const [when, state] of entity.gone ?? []) { if (when > time + 1e-6) break; gone = state; }
  return gone;
}

const yawOf = (pose) => Math.atan2(2 * (pose[6] * pose[5] + pose[3] * pose[4]), 1 - 2 * (pose[4] ** 2 + pose[5] ** 2));

// Believed pose of a body if it is wrong by more than 15 mm or 6 degrees, else null.
function ghostAt(belief, time) {
  const believed = poseAt(belief, time), real = believed && poseAt(world.entities[belief.of], time, new Float32Array(7));
  if (!believed) return null;
  if (!real) return believed;
  const away = Math.hypot(believed[0] - real[0], believed[1] - real[1], believed[2] - real[2]);
  const turn = Math.abs(believed[3] * real[3] + believed[4] * real[4] + believed[5] * real[5] + believed[6] * real[6]);
  return away > 0.015 || turn < 0.9986 ? believed : null;
}

// Standard deviation of the position of a believed thing at a time [m]; 0 where there is no doubt.
function doubtAt(belief, time) {
  let found = 0;
  for (const [since, deviation] of belief.doubt ?? []) if (since <= time) found = deviation;
  return found;
}

// The wheel zooms a view with the focus, or any view with Ctrl; otherwise it scrolls the page.
const mayZoom = (event, view) => event.ctrlKey || event.metaKey || document.activeElement === view;

// Names of things in the messages of a failure at this moment, of its main obstacles, and of the searched thing.
// Text after a semicolon is advice and lists of other things.
function aboutAt(time) {
  const found = new Set(world.wanted ? [world.wanted] : []), at = model.cards.filter((one) => Math.abs((one.time ?? -1) - time) < 0.05);
  const texts = at.flatMap((one) => model.failures[one.failure].chain.flatMap((link) => {
    const most = Math.max(...Object.values(link.blocking ?? {}));
    return [link.message.split(";")[0], (link.advice ?? "").split(";")[0],
      ...Object.entries(link.blocking ?? {}).filter(([, number]) => 4 * number >= most).map(([name]) => name)];
  }));
  const words = new Set(texts.flatMap((text) => text.split(/[^\p{L}\p{N}_-]+/u)));
  for (const { name } of at.length ? model.map?.outlines ?? [] : []) if (words.has(name)) found.add(name);
  return found;
}

// Search for a base pose at a moment: that of a construct that runs or has just failed, else the last one.
function questionAt(time, running = false) {
  const asked = (model.questions ?? []).filter((one) => one.time <= time + 1e-6);
  const inside = asked.findLast((one) => {
    const node = nodes.get(one.node);
    return node && (statusAt(node, time) === "running" || (node.status === "failed" && Math.abs((node.end ?? 0) - time) < 0.05));
  });
  return inside ?? (running ? null : asked.at(-1) ?? null);
}
