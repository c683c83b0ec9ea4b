/* Light or dark: as the system has it, until the button chooses. */

/** Return a function that gives the page its theme and calls `painted`, as every change of the theme does. */
function followTheme(painted) {
  const dark = matchMedia("(prefers-color-scheme: dark)"), { classList } = document.documentElement;
  let chosen = null;
  function paint() {
    classList.toggle("dark", chosen ?? dark.matches);
    painted();
  }
  dark.addEventListener("change", paint);
  document.getElementById("theme").addEventListener("click", () => {
    chosen = !classList.contains("dark");
    paint();
  });
  return paint;
}
