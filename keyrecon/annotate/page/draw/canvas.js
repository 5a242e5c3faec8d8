// Words and crosses on a canvas, readable on any picture.
export { cssColor } from "../../../report/colors.js";
export { prepareCanvas } from "../../../report/figure3d.js";

export const CASING = "rgba(10, 12, 16, .75)"; // the dark rim of everything that is drawn

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
  const directions = [
    [1, 0],
    [-1, 0],
    [0, 1],
    [0, -1],
  ];
  for (const [style, width] of [
    [CASING, 3.5],
    [color, 1.5],
  ]) {
    pen.strokeStyle = style;
    pen.lineWidth = width;
    pen.beginPath();
    for (const [dx, dy] of directions) {
      pen.moveTo(x + 4 * dx, y + 4 * dy);
      pen.lineTo(x + 16 * dx, y + 16 * dy);
    }
    pen.stroke();
  }
}
