// Draws the charts of a swing report.
import { painted } from "./colors.js";

function draw() {
  for (const element of document.querySelectorAll(".chart")) {
    const source = document.getElementById(`chart-${element.dataset.chart}`);
    const figure = painted(JSON.parse(source.textContent));
    Plotly.react(element, figure.data, figure.layout, { displayModeBar: false, responsive: true });
  }
}

addEventListener("DOMContentLoaded", draw);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
