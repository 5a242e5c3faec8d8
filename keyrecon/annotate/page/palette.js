// Beside the picture on the page of colours: what can be clicked, and what was clicked.
import { byId, make } from "./dom.js";
import { NEEDED } from "./parts.js";

const COLORS = [
  "#56b4e9",
  "#e69f00",
  "#f0e442",
  "#cc79a7",
  "#009e73",
  "#d55e00",
  "#0072b2",
  "#ffffff",
];

// Replaces the children of an element when what they show has changed.
function refill(element, shown, children) {
  const label = JSON.stringify(shown);
  if (element.dataset.label === label) return;
  element.dataset.label = label;
  element.replaceChildren(...children());
}

// choose(part), show(frame), remove(pick), name(part)
export function createPalette({ choose, show, remove, name }) {
  const colors = new Map(); // part -> colour, kept while the page is open

  function colorOf(part) {
    if (!colors.has(part)) colors.set(part, COLORS[colors.size % COLORS.length]);
    return colors.get(part);
  }

  function partButton({ part, text, picked, count }, n, current) {
    const swatch = make("i"),
      needed = NEEDED.some((one) => one.part === part) && picked < count;
    swatch.style.background = colorOf(part);
    const button = make(
      "button",
      { data: { part } },
      swatch,
      text,
      make("small", {}, picked ? String(picked) : needed ? "needed" : ""),
      make("kbd", {}, n < 9 ? String(n + 1) : ""),
    );
    button.setAttribute("aria-pressed", part === current);
    button.addEventListener("click", () => choose(part));
    return button;
  }

  function pickRow(pick) {
    const go = make("button", { className: "plain" }, `${pick.part}, frame ${pick.frame}`);
    const label = `Remove ${pick.part} of frame ${pick.frame}`;
    const gone = make("button", { className: "plain", "aria-label": label }, "✕");
    go.addEventListener("click", () => show(pick.frame));
    gone.addEventListener("click", () => remove(pick));
    return make("div", {}, go, gone);
  }

  byId("new-part").addEventListener("submit", (event) => {
    event.preventDefault();
    const part = byId("part-name").value.trim().toLowerCase();
    byId("part-name").value = "";
    if (part) name(part);
  });

  function draw(parts, picks, current) {
    refill(byId("parts"), [parts, current], () =>
      parts.map((part, n) => partButton(part, n, current)),
    );
    refill(byId("pick-list"), picks, () => [...picks].reverse().map(pickRow));
  }

  return { draw, colorOf };
}
