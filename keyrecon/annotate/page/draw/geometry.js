// Where things are on the screen, and what lies under the pointer. A view maps picture to screen:
// screen = scale * picture + (x, y), in CSS pixels of the canvas. Pixel centres are at integers in the
// picture, so its edges lie half a pixel outside of the first and the last.

export const toScreen = (view, [px, py]) => [view.scale * px + view.x, view.scale * py + view.y];
export const toPicture = (view, [sx, sy]) => [
  (sx - view.x) / view.scale,
  (sy - view.y) / view.scale,
];

// The outer edges of a picture of some width and height, as a box.
export const pictureBox = ([width, height]) => [-0.5, -0.5, width - 0.5, height - 0.5];

// [left, top, width, height] of a picture on the screen, for `drawImage`.
export function pictureOnScreen(view, picture) {
  return [...toScreen(view, [-0.5, -0.5]), ...picture.map((extent) => view.scale * extent)];
}

const SLIP = 0.005; // over the edge of the picture, of its longer side: a click there means the edge

// Where a picture was clicked, to a tenth of a pixel and no farther out than its outermost pixel centres;
// null for a click beside it, farther than `slip`.
export function placeIn(picture, place, slip = 0) {
  const inside = place.every((value, axis) => value >= -0.5 - slip && value < picture[axis] - 0.5 + slip);
  if (!inside) return null;
  return place.map((value, axis) => between(0, Math.round(value * 10) / 10, picture[axis] - 1));
}

// The same for what is seen, which a hand that slips over the edge means at the edge.
export const placeSeen = (picture, place) => placeIn(picture, place, SLIP * Math.max(...picture));

export const BESIDE = "That is beside the picture. Shift-click if the joint is hidden there.";

const between = (low, value, high) => Math.max(low, Math.min(high, value));

// The whole of a box in the middle of a canvas, with a margin in CSS pixels.
export function fit([x0, y0, x1, y1], [width, height], margin = 0) {
  const scale = Math.min((width - 2 * margin) / (x1 - x0), (height - 2 * margin) / (y1 - y0));
  return { scale, x: (width - scale * (x0 + x1)) / 2, y: (height - scale * (y0 + y1)) / 2 };
}

// Zooms by a factor; the point under the pointer stays where it is.
export function zoomAt(view, [sx, sy], factor, [least, most]) {
  const scale = between(least, view.scale * factor, most),
    gain = scale / view.scale;
  return { scale, x: sx - gain * (sx - view.x), y: sy - gain * (sy - view.y) };
}

export const pan = (view, [dx, dy]) => ({ ...view, x: view.x + dx, y: view.y + dy });

// Keeps at least a strip of the picture on the canvas.
export function clampToCanvas(view, [width, height], picture, strip = 80) {
  const [x0, y0, x1, y1] = pictureBox(picture).map((edge) => view.scale * edge);
  return {
    scale: view.scale,
    x: between(strip - x1, view.x, width - strip - x0),
    y: between(strip - y1, view.y, height - strip - y0),
  };
}

// A box enlarged by places that lie outside it; null without a box.
export function enclosing(box, places) {
  if (!box) return null;
  const [xs, ys] = [0, 1].map((axis) => places.map((place) => place[axis]));
  return [
    Math.min(box[0], ...xs),
    Math.min(box[1], ...ys),
    Math.max(box[2], ...xs),
    Math.max(box[3], ...ys),
  ];
}

// A box widened about its middle, cut at the picture's edge.
export function enlarged([x0, y0, x1, y1], share, picture) {
  const dx = (x1 - x0) * share,
    dy = (y1 - y0) * share;
  return intersection([x0 - dx, y0 - dy, x1 + dx, y1 + dy], pictureBox(picture));
}

// What two boxes have in common.
export const intersection = (a, b) =>
  a.map((edge, n) => (n < 2 ? Math.max(edge, b[n]) : Math.min(edge, b[n])));

export const distance = ([ax, ay], [bx, by]) => Math.hypot(ax - bx, ay - by);

export function distanceToSegment([px, py], [ax, ay], [bx, by]) {
  const [dx, dy] = [bx - ax, by - ay],
    square = dx * dx + dy * dy;
  const along = square ? between(0, ((px - ax) * dx + (py - ay) * dy) / square, 1) : 0;
  return Math.hypot(px - ax - along * dx, py - ay - along * dy);
}

// Name of the nearest place within a radius, or null; places are on the screen.
export function nearestPlace(pointer, places, radius) {
  let [nearest, least] = [null, radius];
  for (const [name, place] of Object.entries(places)) {
    const far = distance(pointer, place);
    if (far <= least) [nearest, least] = [name, far];
  }
  return nearest;
}

// Name of the limb under the pointer; its ends are left to the joints.
export function nearestLimb(pointer, limbs, places, radius) {
  let [nearest, least] = [null, radius];
  for (const { name, parent } of limbs) {
    if (!places[name] || !places[parent]) continue;
    const far = distanceToSegment(pointer, places[parent], places[name]);
    if (far <= least) [nearest, least] = [name, far];
  }
  return nearest;
}
