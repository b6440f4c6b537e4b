// SPDX-License-Identifier: Apache-2.0
// Holds deploy/grafana/meshwright.json to what Grafana needs of a dashboard: node check-dashboard.mjs FILE.
import { readFileSync } from "node:fs";

const file = process.argv[2];
const dashboard = JSON.parse(readFileSync(file, "utf8"));
const errors = [];
const expect = (condition, message) => {
  if (!condition) errors.push(message);
};

for (const [field, type] of Object.entries({ uid: "string", title: "string", schemaVersion: "number", panels: "object",
  refresh: "string", time: "object", templating: "object" })) {
  expect(typeof dashboard[field] === type, `${field}: ${type} expected`);
}
expect(dashboard.id === undefined, "id: belongs to one Grafana, not into a file");
const variables = new Set(dashboard.templating.list.map((variable) => variable.name));
expect(variables.has("datasource"), "templating: a variable datasource expected");

const kinds = new Set(["row", "stat", "timeseries"]);
const units = new Set(["short", "s", "bytes", "Bps", "percentunit"]);
const ids = new Set();
const taken = new Set();
for (const panel of dashboard.panels) {
  const where = `panel ${panel.id} "${panel.title}"`;
  expect(Number.isInteger(panel.id) && !ids.has(panel.id), `${where}: an id of its own expected`);
  ids.add(panel.id);
  expect(kinds.has(panel.type), `${where}: type ${panel.type} is none of ${[...kinds]}`);
  expect(panel.title?.length > 0, `${where}: title expected`);
  const { x, y, w, h } = panel.gridPos;
  expect([x, y, w, h].every(Number.isInteger) && x >= 0 && w > 0 && h > 0 && x + w <= 24, `${where}: not in the grid`);
  for (let row = y; row < y + h; ++row) {
    for (let column = x; column < x + w; ++column) {
      expect(!taken.has(`${row},${column}`), `${where}: over another one`);
      taken.add(`${row},${column}`);
    }
  }
  if (panel.type === "row") continue;
  expect(panel.description?.length > 0, `${where}: description expected`);
  expect(units.has(panel.fieldConfig.defaults.unit), `${where}: unit ${panel.fieldConfig.defaults.unit}`);
  expect(panel.targets?.length > 0, `${where}: something to show expected`);
  const references = new Set(panel.targets.map((target) => target.refId));
  expect(references.size === panel.targets.length, `${where}: refId twice`);
  for (const target of panel.targets) {
    expect(target.datasource?.uid === "${datasource}", `${where}: datasource is not the variable`);
    expect(typeof target.expr === "string" && target.legendFormat?.length > 0, `${where}: expr and legend expected`);
  }
}
if (errors.length > 0) {
  console.error([...new Set(errors)].map((error) => `${file}: ${error}`).join("\n"));
  process.exit(1);
}
console.log(`${file}: ${dashboard.panels.length} panels`);
