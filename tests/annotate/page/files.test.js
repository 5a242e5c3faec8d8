// Marks from a file: what the page knows of the project once they were taken in.
import assert from "node:assert/strict";
import { test } from "node:test";
import { createFiles } from "../../../keyrecon/annotate/page/views/files.js";

const buttons = [];
const element = (tag) => ({
  tag,
  handlers: {},
  append() {},
  replaceChildren() {},
  addEventListener(kind, handle) {
    this.handlers[kind] = handle;
  },
});
const file = { name: "marks.json", text: async () => "{}" };
let chosen = null;
const page = {
  getElementById: element,
  createElement(tag) {
    const made = element(tag);
    if (tag === "button") buttons.push(made);
    if (tag === "input") chosen = Object.assign(made, { files: [file] });
    return made;
  },
};
const rest = () => new Promise((done) => setTimeout(done, 5));

test("frames of which the page knew nothing are listed once their marks were taken in", async (context) => {
  const { document } = globalThis,
    read = [];
  globalThis.document = page;
  context.after(() => (globalThis.document = document));
  globalThis.fetch = async () => ({ ok: true, status: 200, json: async () => ({ frames: 1, new: 14, conflicts: [] }) });
  createFiles({
    readState: async () => read.push("state"),
    readProject: async () => read.push("project"),
    notifyOfEdit: (text) => read.push(text),
  });
  chosen.handlers.change();
  await rest();
  buttons[0].handlers.click();
  await rest();
  assert.deepEqual(read, ["state", "project", "The marks were taken in; Undo takes them out again."]);
});
