// What a motion is made for: the report, files for other programs, and the video with the figure.
import * as api from "../state/api.js";
import { byId, make, setText } from "./dom.js";

// [suffix, what it is, who reads it]
export const FORMATS = [
  [".bvh", "BVH", "animation: Blender, Maya, MotionBuilder"],
  [".glb", "GLB", "3D scene: Blender, Unity, three.js"],
  [".trc", "TRC", "OpenSim"],
  [".c3d", "C3D", "biomechanics: Visual3D, Mokka, OpenSim"],
  [".csv", "CSV", "tables: Excel, R, pandas"],
  [".nc", "netCDF", "movement, xarray, MATLAB"],
  [".npz", "NPZ", "Python"],
  [".json", "COCO", "joints in the picture, frame by frame"],
];
const OVERLAY = ".mp4";

export function createExports(model, shell) {
  let files = [];

  const refresh = api.latestOnly(
    async () => {
      files = await api.read("exports");
      model.redraw();
    },
    (fault) => model.notify(fault.message),
  );
  model.onProject(refresh); // after a run, what was written is of an older motion

  const boxes = new Map(
    FORMATS.map(([suffix]) => [suffix, make("input", { type: "checkbox", value: suffix })]),
  );
  byId("formats").append(
    ...FORMATS.map(([suffix, name, reader]) =>
      make("label", {}, boxes.get(suffix), make("b", {}, name), make("small", {}, reader)),
    ),
  );
  for (const box of boxes.values()) box.addEventListener("change", model.redraw);
  const chosen = () => [...boxes].filter(([, box]) => box.checked).map(([suffix]) => suffix);
  const ready = () => model.project.has.motion && !shell.runningJob();

  function write(options) {
    if (ready()) shell.startJob("export", options);
  }
  const writeMotion = () => chosen().length && write({ formats: chosen() });
  byId("export-motion").addEventListener("click", writeMotion);
  byId("export-overlay").addEventListener("click", () => write({ formats: [OVERLAY] }));

  function fileRow({ name, bytes, current }) {
    const link = make("a", { href: `/api/exports/${encodeURIComponent(name)}`, download: name }, name);
    return make("div", {}, link, make("small", {}, current ? sizeText(bytes) : "of an earlier motion"));
  }

  function drawFiles() {
    const list = byId("export-list"),
      content = JSON.stringify(files);
    if (list.dataset.content === content) return;
    list.dataset.content = content;
    list.replaceChildren(...files.map(fileRow));
    const place = files[0]?.place;
    setText(byId("export-note"), place ? `They lie in ${place}.` : "Nothing yet.");
  }

  function draw() {
    const { has } = model.project;
    setText(
      byId("report-text"),
      has.report
        ? "What was found, how sure it is, and the figure beside the video; one file that can be passed on."
        : "It is written when the motion is made (3 Motion).",
    );
    byId("report").hidden = !has.report;
    byId("export-motion").disabled = !ready() || !chosen().length;
    byId("export-overlay").disabled = !ready();
    drawFiles();
  }

  return { draw, opened: refresh, refresh, commands: { primary: writeMotion } };
}

const UNITS = ["B", "kB", "MB", "GB"];

// "1.4 MB"
export function sizeText(bytes) {
  const power = Math.min(UNITS.length - 1, Math.floor(Math.log10(Math.max(1, bytes)) / 3)),
    number = bytes / 1000 ** power;
  return `${power && number < 10 ? number.toFixed(1) : Math.round(number)} ${UNITS[power]}`;
}
