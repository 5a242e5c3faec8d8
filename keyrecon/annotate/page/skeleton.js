// The skeleton over the picture. Sides differ by colour and by shape: left is a blue circle, right an
// orange square, the middle a white diamond. A limb is a wedge, broad at the end nearer the camera.

const TAU = 2 * Math.PI;
const BROAD = 4.5,
  NARROW = 1,
  FLAT = 2; // half widths of a limb, px
const CASING = "rgba(10, 12, 16, .75)";

function outline(pen, shape, [x, y], size) {
  pen.beginPath();
  if (shape === "left") pen.arc(x, y, size, 0, TAU);
  else if (shape === "right") pen.rect(x - size * 0.9, y - size * 0.9, size * 1.8, size * 1.8);
  else {
    pen.moveTo(x, y - size * 1.25);
    pen.lineTo(x + size * 1.25, y);
    pen.lineTo(x, y + size * 1.25);
    pen.lineTo(x - size * 1.25, y);
    pen.closePath();
  }
}

// look: {side, color, hollow, alpha, size, ring}
export function drawJoint(pen, place, look) {
  const size = look.size ?? 5;
  pen.save();
  pen.globalAlpha = look.alpha ?? 1;
  if (look.ring) {
    pen.beginPath();
    pen.arc(...place, size + 6, 0, TAU);
    pen.strokeStyle = CASING;
    pen.lineWidth = 4;
    pen.stroke();
    pen.strokeStyle = "#fff";
    pen.lineWidth = 1.75;
    pen.stroke();
  }
  outline(pen, look.side, place, size);
  pen.strokeStyle = CASING;
  pen.lineWidth = look.hollow ? 5 : 3;
  pen.stroke();
  if (look.hollow) {
    pen.strokeStyle = look.color;
    pen.lineWidth = 2;
    pen.stroke();
  } else {
    pen.fillStyle = look.color;
    pen.fill();
  }
  pen.restore();
}

// A wedge from parent to child; sign 1: the child end is nearer, -1 farther, 0 not known.
function wedge(pen, [ax, ay], [bx, by], sign) {
  const length = Math.hypot(bx - ax, by - ay) || 1;
  const [nx, ny] = [(ay - by) / length, (bx - ax) / length];
  const a = sign > 0 ? NARROW : sign < 0 ? BROAD : FLAT,
    b = sign > 0 ? BROAD : sign < 0 ? NARROW : FLAT;
  pen.beginPath();
  pen.moveTo(ax + nx * a, ay + ny * a);
  pen.lineTo(bx + nx * b, by + ny * b);
  pen.lineTo(bx - nx * b, by - ny * b);
  pen.lineTo(ax - nx * a, ay - ny * a);
  pen.closePath();
}

// look: {color, sign, alpha, dashed, warned, under}
export function drawLimb(pen, from, to, look) {
  pen.save();
  pen.lineJoin = "round";
  pen.globalAlpha = look.alpha ?? 1;
  if (look.dashed) {
    pen.beginPath();
    pen.moveTo(...from);
    pen.lineTo(...to);
    pen.setLineDash([5, 5]);
    pen.strokeStyle = look.color;
    pen.lineWidth = 1.5;
    pen.stroke();
  } else {
    wedge(pen, from, to, look.sign);
    pen.strokeStyle = look.under ? "#fff" : CASING;
    pen.lineWidth = look.under ? 3 : 2;
    pen.stroke();
    pen.fillStyle = look.color;
    pen.fill();
  }
  if (look.warned) warn(pen, from, to);
  pen.restore();
}

// A limb that cannot be that long is struck through by a dashed white line.
function warn(pen, from, to) {
  pen.globalAlpha = 1;
  pen.beginPath();
  pen.moveTo(...from);
  pen.lineTo(...to);
  pen.strokeStyle = "#000";
  pen.lineWidth = 3;
  pen.stroke();
  pen.setLineDash([6, 5]);
  pen.strokeStyle = "#fff";
  pen.lineWidth = 2;
  pen.stroke();
}

// A word beside a place, readable on any picture.
export function drawLabel(pen, [x, y], text, bold = false) {
  pen.save();
  pen.font = `${bold ? 600 : 500} 12.5px system-ui, sans-serif`;
  const width = pen.measureText(text).width + 12;
  pen.fillStyle = "rgba(16, 18, 22, .82)";
  pen.beginPath();
  pen.roundRect(x, y - 10, width, 20, 5);
  pen.fill();
  pen.fillStyle = "#fff";
  pen.textBaseline = "middle";
  pen.fillText(text, x + 6, y + 0.5);
  pen.restore();
}

export function drawCross(pen, [x, y], color) {
  for (const [style, width] of [
    [CASING, 3.5],
    [color, 1.5],
  ]) {
    pen.strokeStyle = style;
    pen.lineWidth = width;
    pen.beginPath();
    for (const [dx, dy] of [
      [1, 0],
      [-1, 0],
      [0, 1],
      [0, -1],
    ]) {
      pen.moveTo(x + 4 * dx, y + 4 * dy);
      pen.lineTo(x + 16 * dx, y + 16 * dy);
    }
    pen.stroke();
  }
}
