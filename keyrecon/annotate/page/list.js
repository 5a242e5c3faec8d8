// A list that makes elements only for the rows in sight, so that hundreds of rows scroll smoothly.
import { make } from "./dom.js";

export function createList(root, { height, fill, choose }) {
  const tall = make("div", { className: "tall" });
  root.append(tall);
  const shown = new Map(); // row number -> element
  let items = [],
    current = -1;

  function row(n) {
    if (!shown.has(n)) {
      const element = make("div", { className: "row", role: "option" });
      element.style.transform = `translateY(${n * height}px)`;
      element.addEventListener("click", () => choose(items[n]));
      shown.set(n, element);
      tall.append(element);
    }
    return shown.get(n);
  }

  function draw() {
    const first = Math.max(0, Math.floor(root.scrollTop / height) - 4);
    const last = Math.min(
      items.length,
      Math.ceil((root.scrollTop + root.clientHeight) / height) + 4,
    );
    for (const [n, element] of shown) {
      if (n < first || n >= last) {
        element.remove();
        shown.delete(n);
      }
    }
    for (let n = first; n < last; n++) {
      const element = row(n);
      element.setAttribute("aria-selected", n === current);
      element.setAttribute("aria-posinset", n + 1);
      element.setAttribute("aria-setsize", items.length);
      fill(element, items[n]);
    }
  }

  function reveal(n) {
    const top = n * height,
      bottom = top + height;
    if (top < root.scrollTop) root.scrollTop = Math.max(0, top - height);
    else if (bottom > root.scrollTop + root.clientHeight)
      root.scrollTop = bottom + height - root.clientHeight;
  }

  root.addEventListener("scroll", draw, { passive: true });
  root.addEventListener("keydown", (event) => {
    const by = { ArrowDown: 1, ArrowUp: -1 }[event.key],
      next = items[current + by];
    if (!by) return;
    event.preventDefault();
    event.stopPropagation();
    if (next) choose(next);
  });
  new ResizeObserver(draw).observe(root);

  return {
    show(next, chosen) {
      items = next;
      tall.style.height = `${items.length * height}px`;
      if (chosen !== current && chosen >= 0) reveal(chosen);
      current = chosen;
      draw();
    },
  };
}
