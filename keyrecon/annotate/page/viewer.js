// A picture on a canvas that is zoomed at the pointer and panned by dragging, with an overlay on top.
// Used wherever stills are shown; what a click means is the caller's business.
import { fit, held, pan, toPicture, toScreen, widened, zoomAt } from "./geometry.js";
import { penOf } from "./dom.js";

const STILL = 4; // px a pressed pointer may move and still be a click
const MOST = 16; // screen pixels per picture pixel

export function createViewer({ root, project, stills, changed }) {
  const [below, above] = root.querySelectorAll("canvas");
  const picture = [project.width, project.height];
  let view = null,
    box = null,
    shown = null;

  const size = () => [above.clientWidth, above.clientHeight];
  const whole = () => fit([0, 0, ...picture], size());
  const near = () => (box ? fit(widened(box, 0.12, picture), size(), 12) : whole());

  function setView(next) {
    view = held(next, size(), picture);
    root.dataset.view = [view.scale, view.x, view.y].map((value) => value.toFixed(4)).join(" ");
    shown = null;
    changed();
  }

  // Draws a frame, or the small one until the sharp one is here; true when something was drawn.
  function drawPicture(frame, widths = [undefined]) {
    if (!view) setView(near());
    const found = widths.map((width) => stills.get(frame, width)).find(Boolean);
    const label = `${frame}/${found?.width}/${size()}/${root.dataset.view}`;
    if (!found || shown === label) return Boolean(found);
    const [pen] = penOf(below);
    pen.imageSmoothingQuality = "medium";
    pen.drawImage(found, view.x, view.y, view.scale * picture[0], view.scale * picture[1]);
    shown = label;
    root.dataset.frame = frame;
    return true;
  }

  function zoom(at, factor) {
    setView(zoomAt(view, at, factor, [whole().scale * 0.8, MOST]));
  }

  above.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 30 : 1; // Firefox counts in lines
      zoom([event.offsetX, event.offsetY], Math.exp(-event.deltaY * lines * 0.0016));
    },
    { passive: false },
  );
  new ResizeObserver(() => view && setView(near())).observe(root);

  // grab(at) -> something to drag, or null to pan; drag(thing, at), drop(thing, at), click(at, event).
  function listen({ grab, drag, drop, click, hover }) {
    let press = null;
    const at = (event) => [event.offsetX, event.offsetY];
    above.addEventListener("pointerdown", (event) => {
      above.setPointerCapture(event.pointerId);
      press = {
        start: at(event),
        last: at(event),
        moved: false,
        thing: event.button === 0 ? grab(at(event)) : null,
      };
    });
    above.addEventListener("pointermove", (event) => {
      const now = at(event);
      if (!press) return hover(now);
      const [dx, dy] = [now[0] - press.last[0], now[1] - press.last[1]];
      press.moved ||= Math.hypot(now[0] - press.start[0], now[1] - press.start[1]) > STILL;
      if (!press.moved) return undefined;
      press.last = now;
      return press.thing ? drag(press.thing, toPicture(view, now)) : setView(pan(view, [dx, dy]));
    });
    above.addEventListener("pointerup", (event) => {
      const done = press;
      press = null;
      if (!done) return;
      if (done.moved && done.thing) drop(done.thing, toPicture(view, at(event)));
      else if (!done.moved && event.button === 0) click(at(event), event);
    });
    above.addEventListener("pointercancel", () => {
      press = null;
    });
    above.addEventListener("pointerleave", () => press || hover(null));
    above.addEventListener("contextmenu", (event) => event.preventDefault());
  }

  return {
    listen,
    drawPicture,
    zoom,
    overlay: () => penOf(above),
    toScreen: (place) => toScreen(view, place),
    toPicture: (at) => toPicture(view, at),
    middle: () =>
      toPicture(
        view,
        size().map((extent) => extent / 2),
      ),
    scale: () => view.scale,
    // Shows the surroundings of a box, or the whole picture.
    frameBox(next) {
      box = next ?? null;
      view = null; // made when it is drawn: a hidden canvas has no size
      changed();
    },
    toggleZoom() {
      setView(Math.abs(view.scale - near().scale) < 1e-6 ? whole() : near());
    },
    cursor(name) {
      if (above.style.cursor !== name) above.style.cursor = name;
    },
  };
}
