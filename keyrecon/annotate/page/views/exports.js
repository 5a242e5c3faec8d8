// What a motion is made for: the report, files for other programs, and the video with the figure.
import * as api from "../state/api.js";
import { byId, make, setText, toggle } from "./dom.js";

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
// [value, what it is]
export const VIEWS = [
  ["camera", "the video itself"],
  ["right", "from the right"],
  ["left", "from the left"],
  ["back", "from behind"],
  ["above", "from above"],
];
export const SKELETONS = [
  ["all", "all joints"],
  ["upper", "the upper body"],
  ["lower", "the lower body"],
  ["left", "the left side"],
  ["right", "the right side"],
  ["none", "none"],
];
export const SPEEDS = [["1", "as it was"], ["2", "half"], ["4", "a quarter"], ["8", "an eighth"]];
export const SIZES = [["", "as the video"], ["480", "480"], ["720", "720"], ["1080", "1080"]];

const choice = (rows, label) => {
  const field = make("select", { "aria-label": label });
  field.append(...rows.map(([value, text]) => make("option", { value }, text)));
  return field;
};

// What a golf fit writes by itself.
const FITTED = { "golf.csv": "the numbers and curves of the swing", "overlay.mp4": "body and club over the video" };

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

  const last = model.project.n_frames - 1,
    range = ["First frame", "Last frame"].map((label, n) => {
      const field = make("input", { type: "text", inputMode: "numeric", size: 6, value: n ? last : 0 });
      field.setAttribute("aria-label", label);
      field.addEventListener("input", model.redraw);
      return field;
    }),
    said = make("small", {});
  byId("export-range").append("Frames ", range[0], " to ", range[1], " ", said);
  const views = VIEWS.map(([value]) => make("input", { type: "checkbox", value, checked: value === "camera" })),
    [skeleton, speed, size] = [choice(SKELETONS, "Figure"), choice(SPEEDS, "Speed"), choice(SIZES, "Height, px")];
  for (const field of [...views, speed]) field.addEventListener("change", model.redraw);
  byId("overlay-choices").append(
    make("b", {}, "Views, side by side"),
    make("div", {}, ...VIEWS.map(([, text], n) => make("label", {}, views[n], text))),
    make("b", {}, "Figure"),
    skeleton,
    make("b", {}, "Speed"),
    speed,
    make("b", {}, "Height, px"),
    size,
  );

  // {first, last} of the part that is to be written, {} for the whole, null where it cannot be.
  function part() {
    const [from, to] = range.map((field) => (/^\d+$/.test(field.value.trim()) ? Number(field.value) : NaN));
    if (!(from <= to && to <= last)) return null;
    return from === 0 && to === last ? {} : { first: from, last: to };
  }

  function write(options) {
    if (ready() && part()) shell.startJob("export", { ...part(), ...options });
  }
  const writeMotion = () => chosen().length && write({ formats: chosen() });
  const chosenViews = () => views.filter((box) => box.checked).map((box) => box.value);
  byId("export-motion").addEventListener("click", writeMotion);
  byId("export-overlay").addEventListener("click", () =>
    write({
      formats: [OVERLAY],
      view: chosenViews(),
      skeleton: skeleton.value,
      slowmo: Number(speed.value),
      ...(size.value ? { size: Number(size.value) } : {}),
    }),
  );

  function fileRow({ name, bytes, current, fitted }) {
    const address = `/api/${fitted ? "fitted" : "exports"}/${encodeURIComponent(name)}`,
      link = make("a", { href: address, download: name }, name);
    const told = current ? [fitted ? FITTED[name] : null, sizeText(bytes)].filter(Boolean).join(", ") : "of an earlier motion";
    return make("div", {}, link, make("small", {}, told));
  }

  function drawFiles() {
    const list = byId("export-list"),
      content = JSON.stringify(files);
    if (list.dataset.content === content) return;
    list.dataset.content = content;
    list.replaceChildren(...files.map(fileRow));
    const places = [...new Set(files.map(({ place }) => place))].join(" and ");
    setText(byId("export-note"), places ? `They lie in the folder ${places}.` : "Nothing yet.");
  }

  function draw() {
    const { has } = model.project,
      doubtful = Boolean(model.swing?.doubts?.length),
      lacked = has.report && model.project.run.report_lacks;
    toggle(byId("report-text"), "wrong", doubtful || lacked);
    setText(
      byId("report-text"),
      doubtful
        ? "The fit of this swing is doubtful: do not use its numbers. 2 Swing tells what is, and what to do."
        : lacked
        ? `It does not know the ${lacked} yet: make the motion anew (3 Motion).`
        : has.report
        ? "What was found, how sure it is, and the figure beside the video; one file that can be passed on."
        : `It is written when ${model.project.golf ? "the swing is fitted (2 Swing)" : "the motion is made (3 Motion)"}.`,
    );
    byId("report").hidden = !has.report;
    const whole = part(),
      seconds = whole && ((whole.last ?? last) - (whole.first ?? 0) + 1) / model.project.fps;
    setText(said, whole ? `${seconds.toFixed(2)} s` : `two frames from 0 to ${last}, the first first`);
    toggle(said, "wrong", !whole);
    setText(
      byId("overlay-said"),
      whole
        ? `Frames ${whole.first ?? 0} to ${whole.last ?? last}; plays for ${(seconds * Number(speed.value)).toFixed(1)} s.`
        : "",
    );
    byId("export-motion").disabled = !ready() || !chosen().length || !whole;
    byId("export-overlay").disabled = !ready() || !chosenViews().length || !whole;
    setText(byId("files-count"), files.length ? String(files.length) : "");
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
