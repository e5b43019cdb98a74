// Training and edits: the parts of the panel that are there where a model is being trained (docs/viewer.md).
import { element, short, rate, clamp, luminance } from "./tools.js";

const get = id => document.getElementById(id);
const hex = rgb => "#" + rgb.map(v => Math.round(255 * clamp(v, 0, 1) ** (1 / 2.2)).toString(16).padStart(2, "0")).join("");
const linear = text => [1, 3, 5].map(i => +((parseInt(text.slice(i, i + 2), 16) / 255) ** 2.2).toFixed(4));
const clock = s => s < 60 ? `${s.toFixed(1)} s` : `${Math.floor(s / 60)} min ${Math.floor(s % 60)} s`;

// A factor of a light as the page shows it: on or off, stops, and a colour of luminance 1 (its largest number is 1 in
// the field, which holds no more).
function partsOf(factor, kept) {
  const y = luminance(factor);
  if (y <= 0) return { ...kept, on: false };
  const most = Math.max(...factor);
  return { on: true, stops: Math.log2(y), tint: factor.map(v => v / most) };
}
function factorOf({ on, stops, tint }) {
  const scale = on ? 2 ** stops / luminance(tint) : 0;
  return tint.map(v => +(v * scale).toPrecision(6));
}

export class TrainingPanel {
  constructor(viewer) {
    this.viewer = viewer;
    this.curves = null;
    this.status = null;
    this.scene = null;
    this.kept = [];       // of each light: what its fields say while it is off
    this.material = null;
    for (const button of document.querySelectorAll("[data-train]"))
      button.addEventListener("click", () => viewer.send({ type: "train", do: button.dataset.train }));
    get("all-lights").addEventListener("input", event => this.scaleAll(+event.target.value));
    get("all-lights").addEventListener("change", event => { event.target.value = 0; this.base = null; });
    get("material").addEventListener("change", event => { this.material = +event.target.value; this.showMaterial(); });
    get("material-color").addEventListener("input", event => this.editMaterial({ color: linear(event.target.value) }));
    get("material-roughness").addEventListener("input", event => this.editMaterial({ roughness: +event.target.value }));
    get("material-reset").addEventListener("click", () => viewer.send({ type: "edit", material: this.material }));
    new ResizeObserver(() => this.draw()).observe(get("curves"));
  }

  // What the server says when a connection begins; null where nothing is trained.
  begin(training) {
    for (const part of document.querySelectorAll(".training")) part.hidden = !training;
    this.curves = training && training.curves;
  }

  told(message) {
    if (message.type === "scene") {
      this.scene = message;
      this.showScene();
      return;
    }
    const had = this.status;
    this.status = message;
    if (had && had.step !== message.step && message.loss >= 0 && this.curves) {
      const last = this.curves.seconds.at(-1) ?? -1;
      if (message.seconds > last) {
        for (const [curve, value] of [["seconds", message.seconds], ["loss", message.loss], ["rate", message.rate], ["mape", message.mape]])
          this.curves[curve].push(value);
      }
      if (this.curves.seconds.length > 3000) for (const curve of Object.keys(this.curves)) this.curves[curve] = this.curves[curve].filter((v, i) => i % 2 === 0);
    }
    this.showStatus();
    this.draw();
  }

  showStatus() {
    const s = this.status;
    const state = s.finished && s.state === "idle" ? "finished" : s.state;
    const rows = [["training", s.change > 0 ? `${s.state === "idle" ? "learning the change" : state}, ${Math.round(100 * (1 - s.change))} % of the change` : state],
      ["step", s.steps >= s.step ? `${s.step} of ${s.steps}` : String(s.step)], ["time", s.budget >= s.seconds ? `${clock(s.seconds)} of ${clock(s.budget)}` : clock(s.seconds)],
      ["loss", s.loss < 0 ? "–" : short(s.loss)], ["validation MAPE", s.mape < 0 ? "–" : short(s.mape)], ["learning rate", `${short(s.rate)} of the configured`],
      ["points", rate(s.points_per_s)], ["queries", rate(s.queries_per_s)], ["time for pictures", `${Math.round(100 * s.share)} %`],
      ["saved", s.saved === null ? "not yet" : `step ${s.saved}`]];
    if (s.error) rows.push(["trouble", s.error]);
    get("training-status").replaceChildren(...rows.map(row => element("tr", {}, ...row.map(cell => element("td", {}, cell)))));
    document.querySelector("[data-train=stop]").title = (s.saves ? "saves, and " : "") + (s.ends ? "ends when the last page is closed" : "takes no more steps");
    this.enable();
  }

  enable() {
    const s = this.status, controls = this.viewer.controls;
    const able = { start: s && s.state !== "running", pause: s && (s.state === "running" || s.change > 0) && s.state !== "paused", save: s && s.saves, stop: s && s.state !== "stopped" };
    for (const button of document.querySelectorAll("[data-train]")) button.disabled = !controls || !able[button.dataset.train];
  }

  // Loss and validation error against seconds, each on its own logarithmic scale, and the learning rate at the bottom.
  draw() {
    const canvas = get("curves"), scale = window.devicePixelRatio || 1;
    const width = canvas.clientWidth, height = canvas.clientHeight;
    if (!this.curves || width === 0) return;
    Object.assign(canvas, { width: Math.round(width * scale), height: Math.round(height * scale) });
    const painter = canvas.getContext("2d"), style = getComputedStyle(document.documentElement);
    const color = name => style.getPropertyValue(name).trim();
    painter.scale(scale, scale);
    painter.font = "11px system-ui, sans-serif";
    const { seconds } = this.curves, left = 4, right = width - 4, top = 16, bottom = height - 30;
    const end = Math.max(seconds.at(-1) || 0, 1e-3), begin = Math.min(seconds[0] || 0, end * 0.999);
    const x = s => left + (right - left) * (s - begin) / (end - begin);
    painter.strokeStyle = color("--line");
    painter.strokeRect(left, top, right - left, bottom - top);
    painter.fillStyle = color("--quiet");
    painter.textAlign = "left";
    painter.fillText(clock(begin), left, height - 2);
    painter.textAlign = "right";
    painter.fillText(clock(end), right, height - 2);
    painter.textAlign = "center";
    painter.fillText("learning rate", (left + right) / 2, height - 2);
    const line = (points, y, width = 1.5) => {
      painter.lineWidth = width;
      painter.beginPath();
      points.forEach(([s, v], i) => painter[i ? "lineTo" : "moveTo"](x(s), y(v)));
      painter.stroke();
    };
    const logarithmic = (name, label, ink, align) => {
      const points = seconds.map((s, i) => [s, this.curves[name][i]]).filter(([, v]) => v > 0);
      if (points.length === 0) return;
      const values = points.map(([, v]) => Math.log(v)), low = Math.min(...values), high = Math.max(...values, low + 0.1);
      painter.strokeStyle = painter.fillStyle = color(ink);
      line(points, v => bottom - 3 - (bottom - top - 6) * (Math.log(v) - low) / (high - low));
      painter.textAlign = align;
      painter.fillText(`${label} ${short(points.at(-1)[1])}`, align === "left" ? left : right, 11);
    };
    logarithmic("loss", "loss", "--loss", "left");
    logarithmic("mape", "MAPE", "--mape", "right");
    painter.strokeStyle = color("--quiet");
    line(seconds.map((s, i) => [s, this.curves.rate[i]]), v => bottom + 15 - 12 * clamp(v, 0, 1), 1);
  }

  // --- lights

  showScene() {
    const { lights, materials } = this.scene;
    // What is still to be sent is newer than what the server says.
    lights.forEach((light, i) => {
      if (!this.waiting || !this.waiting.has("light" + i)) this.kept[i] = partsOf(light.factor, this.kept[i] || { stops: 0, tint: [1, 1, 1] });
    });
    const list = get("lights");
    if (list.children.length !== lights.length) list.replaceChildren(...lights.map((light, i) => this.lightRow(light, i)));
    lights.forEach((light, i) => {
      const [on, power, value, color] = ["on", "power", "value", "color"].map(part => list.children[i].querySelector(`[data-part=${part}]`));
      on.checked = this.kept[i].on;
      if (document.activeElement !== power) power.value = this.kept[i].stops;
      value.textContent = `${this.kept[i].stops > 0 ? "+" : ""}${this.kept[i].stops.toFixed(1)}`;
      if (document.activeElement !== color) color.value = hex(this.kept[i].tint);
    });
    get("lights-section").hidden = lights.length === 0;
    const select = get("material");
    if (select.options.length !== materials.length) {
      select.replaceChildren(...materials.map(m => element("option", { value: m.material }, `${m.name || `material ${m.material}`} (${m.model})`)));
      this.material ??= materials.length > 0 ? materials[0].material : null;
    }
    get("materials-section").hidden = materials.length === 0;
    this.showMaterial();
  }

  lightRow(light, i) {
    const on = element("input", { type: "checkbox", "data-part": "on", "aria-label": `${light.name} on` });
    const power = element("input", { type: "range", min: -6, max: 6, step: 0.1, "data-part": "power", "aria-label": `power of ${light.name}` });
    const color = element("input", { type: "color", "data-part": "color", "aria-label": `colour of ${light.name}` });
    on.addEventListener("change", () => this.editLight(i, { on: on.checked }));
    power.addEventListener("input", () => this.editLight(i, { on: true, stops: +power.value }));
    color.addEventListener("input", () => this.editLight(i, { on: true, tint: linear(color.value).map(v => Math.max(v, 1e-3)) }));
    return element("label", { class: "light", title: light.kind }, on, element("span", {}, light.name), power, element("output", { "data-part": "value" }), color);
  }

  editLight(i, change) {
    const now = this.kept[i] = { ...this.kept[i], ...change };
    this.later("light" + i, () => ({ type: "edit", lights: [{ light: i, factor: factorOf(now) }] }));
  }

  // All lights, by so many stops from where they were when the slider was taken; at most 500 in one message.
  scaleAll(stops) {
    this.base ??= this.scene.lights.map(light => light.factor);
    const lights = this.base.map((factor, light) => ({ light, factor: factor.map(v => +(v * 2 ** stops).toPrecision(6)) }));
    lights.forEach(({ light, factor }) => { this.scene.lights[light].factor = factor; });  // the next move may begin here
    for (let i = 0; i < lights.length; i += 500)
      this.later("all" + i, () => ({ type: "edit", lights: lights.slice(i, i + 500) }));
  }

  // --- materials

  choose(material) {
    if (!this.scene || !this.scene.materials.some(m => m.material === material)) return;
    this.material = material;
    this.showMaterial();
  }

  showMaterial() {
    const m = this.scene.materials.find(other => other.material === this.material);
    if (!m) return;
    get("material").value = m.material;
    const color = m.edit.color || m.color, roughness = m.edit.roughness ?? m.roughness;
    get("material-color-row").hidden = m.color === undefined;
    get("material-roughness-row").hidden = m.roughness === undefined;
    if (document.activeElement !== get("material-color")) get("material-color").value = hex(color || [0.5, 0.5, 0.5]);
    get("material-color-value").textContent = color ? "" : "textured";
    if (document.activeElement !== get("material-roughness")) get("material-roughness").value = roughness ?? 0.1;
    get("material-roughness-value").textContent = roughness === null || roughness === undefined ? "textured" : short(roughness);
  }

  editMaterial(change) {
    const m = this.scene.materials.find(other => other.material === this.material);
    const now = m.edit = { ...m.edit, ...change };
    this.later("material" + m.material, () => ({ type: "edit", material: m.material, ...now }));
    this.showMaterial();
  }

  // Sends the newest of what a slider says ten times a second.
  later(what, message) {
    this.waiting ??= new Map();
    const due = !this.waiting.has(what);
    this.waiting.set(what, message);
    if (due) setTimeout(() => { const send = this.waiting.get(what); this.waiting.delete(what); this.viewer.send(send()); }, 100);
  }
}
