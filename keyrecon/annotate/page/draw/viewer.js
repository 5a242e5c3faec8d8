// A picture on a canvas that is zoomed at the pointer and panned by dragging, with an overlay on top.
// Used wherever frames are shown; what a click means is the caller's business.
import { prepareCanvas } from "./canvas.js";
import {
  clampToCanvas,
  enlarged,
  fit,
  pan,
  pictureBox,
  pictureOnScreen,
  toPicture,
  toScreen,
  zoomAt,
} from "./geometry.js";

const CLICK_SLOP = 4; // px a pressed pointer may move and still be a click
const MAX_SCALE = 16; // screen pixels per picture pixel
const ZOOM_PER_PIXEL = 0.0016; // of the wheel, as an exponent
const PIXELS_PER_LINE = 30; // where a wheel counts in lines, as in Firefox
const SURROUNDINGS = 0.12; // share of a box's size shown around it

export function createViewer({ root, project, frames, redraw }) {
  const [below, above] = root.querySelectorAll("canvas");
  const picture = [project.width, project.height];
  let view = null, // made when it is drawn: a hidden canvas has no size
    box = null,
    press = null, // of the pointer, until it is released: {start, last, moved, grabbed, shown}
    drawn = null, // what is on the canvas
    shown = null; // the frame that is on the canvas

  let cancel = () => {}; // of the listener, where what is dragged is let go

  const size = () => [above.clientWidth, above.clientHeight];
  const whole = () => fit(pictureBox(picture), size());
  const near = () => (box ? fit(enlarged(box, SURROUNDINGS, picture), size(), 12) : whole());

  const onScreen = () => pictureOnScreen(view, picture);

  function setView(next) {
    view = clampToCanvas(next, size(), picture);
    root.dataset.view = [view.scale, view.x, view.y].map((value) => value.toFixed(4)).join(" ");
    drawn = null;
    redraw();
  }

  // Draws a frame, or the small one until the sharp one is here; true when something was drawn.
  function drawPicture(frame, widths = [undefined]) {
    if (!view) setView(near());
    const image = widths.map((width) => frames.get(frame, width)).find(Boolean);
    const label = `${frame}/${image?.width}/${size()}/${root.dataset.view}`;
    root.classList.toggle("late", !image && shown !== null && shown !== frame);
    if (!image || drawn === label) return Boolean(image);
    const [pen] = prepareCanvas(below);
    pen.imageSmoothingQuality = "medium";
    pen.drawImage(image, ...onScreen());
    drawn = label;
    shown = frame;
    root.dataset.frame = frame;
    return true;
  }

  function zoom(at, factor) {
    if (view) setView(zoomAt(view, at, factor, [whole().scale * 0.8, MAX_SCALE]));
  }

  above.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      const unit = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? PIXELS_PER_LINE : 1;
      zoom([event.offsetX, event.offsetY], Math.exp(-event.deltaY * unit * ZOOM_PER_PIXEL));
    },
    { passive: false },
  );
  new ResizeObserver(() => view && setView(near())).observe(root);

  // What is held is of the picture it was taken hold of in: in another one, or on another page, it is let go.
  function forgetPress() {
    if (press?.grabbed && (press.shown !== shown || !root.clientWidth)) letGo();
  }
  function letGo() {
    const dragged = press?.grabbed && press.moved;
    press = null;
    if (dragged) cancel();
  }

  // grab(at) -> what is dragged, or null to pan; drag(grabbed, at), drop(grabbed, at), click(at, event);
  // cancelled() where a drag ends without a drop.
  function listen({ grab, drag, drop, click, hover, cancelled = () => {} }) {
    cancel = cancelled;
    const at = (event) => [event.offsetX, event.offsetY];
    above.addEventListener("pointerdown", (event) => {
      if (!view) return;
      above.setPointerCapture(event.pointerId);
      press = {
        start: at(event),
        last: at(event),
        moved: false,
        shown,
        grabbed: event.button === 0 ? grab(at(event)) : null,
      };
    });
    above.addEventListener("pointermove", (event) => {
      const now = at(event);
      if (!view) return undefined;
      forgetPress();
      if (!press) return hover(now);
      const [dx, dy] = [now[0] - press.last[0], now[1] - press.last[1]];
      press.moved ||= Math.hypot(now[0] - press.start[0], now[1] - press.start[1]) > CLICK_SLOP;
      if (!press.moved) return undefined;
      press.last = now;
      return press.grabbed ? drag(press.grabbed, toPicture(view, now)) : setView(pan(view, [dx, dy]));
    });
    above.addEventListener("pointerup", (event) => {
      forgetPress();
      const done = press;
      press = null;
      if (!done) return;
      if (done.moved && done.grabbed) drop(done.grabbed, toPicture(view, at(event)));
      else if (!done.moved && event.button === 0) click(at(event), event);
    });
    above.addEventListener("pointercancel", letGo);
    above.addEventListener("pointerleave", () => press || hover(null));
    above.addEventListener("contextmenu", (event) => event.preventDefault());
  }

  return {
    listen,
    drawPicture,
    zoom,
    overlay: () => prepareCanvas(above),
    toScreen: (place) => toScreen(view ?? whole(), place),
    toPicture: (at) => toPicture(view ?? whole(), at),
    // What is in the middle of the canvas; before the first picture, the middle of that.
    middle: () =>
      view
        ? toPicture(
            view,
            size().map((extent) => extent / 2),
          )
        : picture.map((extent) => (extent - 1) / 2),
    scale: () => (view ?? whole()).scale,
    // [left, top, width, height] of the whole picture, for what is laid over it.
    onScreen,
    // The frame whose picture is on the canvas, null before the first: what is drawn over it belongs to it.
    shown: () => shown,
    // Shows the surroundings of a box, or the whole picture.
    frameBox(next) {
      box = next ?? null;
      view = null;
      letGo();
      redraw();
    },
    toggleZoom() {
      if (view) setView(Math.abs(view.scale - near().scale) < 1e-6 ? whole() : near());
    },
    cursor(name) {
      if (above.style.cursor !== name) above.style.cursor = name;
    },
  };
}
