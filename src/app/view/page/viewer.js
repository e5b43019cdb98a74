// The page of octrad view. The server holds the state; the page asks for changes and shows what comes (docs/viewer.md).
import { add, subtract, normalize, clamp, axes, turned, tangentX, copyOf, element, saveFile, short, list, bytes, rate, quoted, length,
         luminance }
  from "./tools.js";
import { TrainingPanel } from "./training.js";

const get = id => document.getElementById(id);
const token = new URLSearchParams(location.hash.slice(1)).get("token") || "";
const canvas = get("canvas"), painter = canvas.getContext("2d"), stage = get("stage");

class Viewer {
  constructor() {
    this.hello = null;       // what there is
    this.state = null;       // what is shown, as the server says
    this.frame = null;       // header of the last frame
    this.pictures = {};      // its bitmaps by name
    this.camera = null;      // where this page is
    this.pivot = null;       // a point to orbit about
    this.mode = "split";     // of comparing
    this.split = 0.5;
    this.drive = "fly";
    this.speed = 0;          // doublings
    this.held = new Set();   // keys that are down
    this.pointers = new Map();
    this.clicks = null;      // what the next click does: "inspect", "white"
    this.asked = new Map();  // answers that are waited for, by number
    this.inputs = 0;
    this.number = 0;
    this.unsent = false;
    this.keys = [];
    this.playing = null;
    this.times = [];
    this.pose_list = [];
    this.retry = 1000;
    this.training = new TrainingPanel(this);
    this.build();
    this.listen();
    this.connect();
    requestAnimationFrame(time => this.tick(time));
  }

  get controls() { return !!this.state && !!this.hello && this.state.controller === this.hello.you; }

  // --- the connection

  async connect() {
    const connection = this.connection = (this.connection || 0) + 1;
    this.newest = 0;  // number of the newest frame of this connection
    get("status").textContent = "connecting";
    try {
      const answer = await fetch(`/check?token=${encodeURIComponent(token)}`);
      if (answer.status === 403) return this.say("This address has no valid token.\nOpen the whole address that octrad view printed, with what stands behind the #.");
    } catch {
      return this.lost("The program cannot be reached.");
    }
    const socket = this.socket = new WebSocket(`ws://${location.host}/stream?token=${encodeURIComponent(token)}`);
    socket.binaryType = "arraybuffer";
    let opened = false;
    this.heard = performance.now();
    socket.onopen = () => { opened = true; this.retry = 1000; this.say(""); };
    socket.onmessage = event => {
      this.heard = performance.now();
      if (typeof event.data === "string") this.told(JSON.parse(event.data));
      else this.received(event.data, connection);
    };
    socket.onclose = () => this.lost(opened ? "The connection ended." : "The program takes no more viewers.");
  }

  // The server says something every 30 s at least, behind the frame that it is sending. A connection that has died, of a
  // computer that slept for example, is not always closed.
  checkConnection() {
    if (!this.socket || this.socket.readyState !== WebSocket.OPEN || performance.now() - this.heard < 120000) return;
    this.socket.onclose = this.socket.onmessage = null;
    this.socket.close();
    this.lost("Nothing has come for two minutes.");
  }

  lost(why) {
    this.hello = this.state = null;
    for (const resolve of this.asked.values()) resolve(null);
    this.asked.clear();
    this.show();
    get("status").textContent = "not connected";
    this.say(`${why}\nTrying again in ${Math.round(this.retry / 1000)} s. What is shown is the last picture.`);
    setTimeout(() => this.connect(), this.retry);
    this.retry = Math.min(this.retry * 1.5, 10000);
  }

  send(message) {
    if (this.socket && this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }
  set(change) { this.send({ type: "set", ...change }); }

  // The answer, or null where the connection ended before it came.
  ask(message) {
    const id = ++this.number;
    this.send({ ...message, id });
    return new Promise(resolve => this.asked.set(id, resolve));
  }

  told(message) {
    if (message.type === "hello") {
      this.hello = message;
      this.training.begin(message.training);
      this.offer();
    } else if (message.type === "state") {
      const had = this.controls;
      this.state = message;
      if (!this.camera || (!had && this.controls)) this.camera = copyOf(message.camera);
      this.show();
      if (this.frame) this.statistics();
    } else if (message.type === "pick") {
      const resolve = this.asked.get(message.id);
      this.asked.delete(message.id);
      if (resolve) resolve(message);
    } else if (message.type === "training" || message.type === "scene") {
      this.training.told(message);
    } else if (message.type === "path") {
      this.playing = { frames: message.frames, fps: message.fps, start: null };
    } else if (message.type === "error") {
      this.say(message.message, true);
      if (message.input !== null && this.frame) this.camera = copyOf(this.frame.camera);  // back to one that was accepted
    }
  }

  async received(buffer, connection = this.connection) {
    const size = new DataView(buffer).getUint32(0, true);
    const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, size)));
    let at = 4 + size;
    const parts = header.pictures.map(({ name, bytes: n }) => {
      const blob = new Blob([new Uint8Array(buffer, at, n)], { type: "image/jpeg" });
      at += n;
      return [name, blob];
    });
    const pictures = {};
    try {
      await Promise.all(parts.map(async ([name, blob]) => { pictures[name] = await createImageBitmap(blob); }));
    } finally {
      if (connection === this.connection) this.send({ type: "ack", frame: header.frame });
    }
    if (connection !== this.connection || header.frame < this.newest) {
      for (const late of Object.values(pictures)) late.close();
      return;
    }
    this.newest = header.frame;
    for (const old of Object.values(this.pictures)) old.close();
    this.frame = header;
    this.pictures = pictures;
    this.times.push(performance.now());
    if (this.times.length > 20) this.times.shift();
    if (!this.controls) this.camera = copyOf(header.camera);
    this.draw();
    this.statistics();
  }

  say(text, mild = false) {
    const message = get("message");
    clearTimeout(this.silence);
    message.hidden = !text;
    message.textContent = text;
    message.classList.toggle("mild", mild);
    if (mild) this.silence = setTimeout(() => this.say(""), 6000);
  }

  // --- moving

  moved() {
    this.unsent = true;
    this.playing = null;
  }

  tick(time) {
    requestAnimationFrame(next => this.tick(next));  // first: a mistake in one frame must not be the end of all
    const seconds = Math.min((time - (this.last || time)) / 1000, 0.1);
    this.last = time;
    if (this.controls && this.camera) {
      if (this.playing) this.play(time);
      else if (this.held.size > 0) this.fly(seconds);
      if (this.unsent) {
        this.unsent = false;
        this.set({ camera: this.camera, input: ++this.inputs });
      }
    }
  }

  fly(seconds) {
    const { forward, right, vertical } = axes(this.camera);
    const axis = (plus, minus) => (this.held.has(plus) ? 1 : 0) - (this.held.has(minus) ? 1 : 0);
    let step = add(add(forward.map(v => v * axis("KeyW", "KeyS")), right, axis("KeyD", "KeyA")), vertical, axis("KeyE", "KeyQ"));
    if (length(step) === 0) return;
    const way = this.pace() * seconds * (this.held.has("ShiftLeft") || this.held.has("ShiftRight") ? 4 : 1);
    step = normalize(step).map(v => v * way);
    this.camera.origin = add(this.camera.origin, step);
    this.camera.target = add(this.camera.target, step);
    this.pivot = null;
    this.moved();
  }

  // World units a second.
  pace() { return this.hello ? 0.25 * this.hello.radius * 2 ** this.speed : 0; }

  look(right, upwards) {
    const { forward, vertical, hand } = axes(this.camera);
    this.camera.target = add(this.camera.origin, turned(forward, vertical, hand * right, upwards));
    this.pivot = null;
    this.moved();
  }

  orbit(right, upwards) {
    const pivot = this.pivot || add(this.camera.origin, axes(this.camera).forward, 0.5 * this.hello.radius);
    const { forward, vertical, hand } = axes(this.camera);
    const to = subtract(pivot, this.camera.origin), distance = length(to);
    const before = normalize(to), after = turned(before, vertical, -hand * right, -upwards);
    // The view turns with the direction to the pivot, so that the pivot stays where it is in the picture.
    const turn = turned(forward, vertical, -hand * right, -upwards);
    this.camera.origin = add(pivot, after, -distance);
    this.camera.target = add(this.camera.origin, turn);
    this.moved();
  }

  shift(right, up, ahead) {
    const { forward, right: x, up: y } = axes(this.camera);
    const step = add(add(x.map(v => v * right), y, up), forward, ahead);
    this.camera.origin = add(this.camera.origin, step);
    this.camera.target = add(this.camera.target, step);
    this.moved();
  }

  go(camera) {
    if (!this.controls) return this.say("Another viewer has the controls.", true);
    this.camera = { ...copyOf(camera) };
    for (const key of ["width", "height", "name", "time"]) delete this.camera[key];
    this.pivot = null;
    this.moved();
    this.show();
  }

  // Where the picture of the file was taken, at its size.
  goToStored() {
    const { camera, width, height } = this.hello.stored, { least_size: least, largest_size: largest } = this.hello.limits;
    if (Math.min(width, height) >= least && Math.max(width, height) <= largest) this.set({ width, height });
    if (camera) this.go(camera);
  }

  async findPivot() {
    const found = await this.ask({ type: "pick", x: 0.5, y: 0.5 });
    if (found && found.hit) this.pivot = found.position;
  }

  async lookAt(at) {
    const found = await this.ask({ type: "pick", ...at });
    if (!found || !found.hit) return;
    this.pivot = found.position;
    this.camera.target = found.position;
    this.moved();
  }

  play(time) {
    const p = this.playing;
    p.start ??= time;
    const n = Math.floor((time - p.start) / 1000 * p.fps);
    if (n >= p.frames.length) this.playing = null;
    else if (n !== p.shown) {
      p.shown = n;
      this.camera = copyOf(p.frames[n]);
      this.pivot = null;
      this.unsent = true;
    }
  }

  // --- the picture

  // Where it lies on the canvas, in CSS pixels.
  place() {
    const width = canvas.clientWidth, height = canvas.clientHeight;
    const aspect = this.state ? this.state.width / this.state.height : this.frame ? this.frame.width / this.frame.height : 16 / 9;
    const w = Math.min(width, height * aspect), h = w / aspect;
    return { x: (width - w) / 2, y: (height - h) / 2, w, h };
  }

  at(event) {
    const box = canvas.getBoundingClientRect(), p = this.place();
    const x = (event.clientX - box.left - p.x) / p.w, y = (event.clientY - box.top - p.y) / p.h;
    return x >= 0 && x <= 1 && y >= 0 && y <= 1 ? { x, y } : null;
  }

  draw() {
    const scale = window.devicePixelRatio || 1, width = Math.round(canvas.clientWidth * scale), height = Math.round(canvas.clientHeight * scale);
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    painter.clearRect(0, 0, width, height);
    const { a, b, errors } = this.pictures, p = this.place();
    if (!a) return;
    painter.imageSmoothingQuality = "high";
    const put = (picture, from, to) => {
      painter.save();
      painter.beginPath();
      painter.rect((p.x + p.w * from) * scale, p.y * scale, p.w * (to - from) * scale, p.h * scale);
      painter.clip();
      painter.drawImage(picture, p.x * scale, p.y * scale, p.w * scale, p.h * scale);
      painter.restore();
    };
    const asked = !b ? "a" : !this.controls && this.state && this.state.errors ? "errors" : this.mode;  // who watches sees the errors, too
    const mode = asked === "errors" && !errors ? "a" : asked;
    if (mode === "split") {
      put(a, 0, this.split);
      put(b, this.split, 1);
    } else {
      put(mode === "b" ? b : mode === "errors" ? errors : a, 0, 1);
    }
    const divider = get("divider");
    divider.hidden = mode !== "split";
    divider.setAttribute("aria-valuenow", Math.round(100 * this.split));
    Object.assign(divider.style, { left: `${p.x + p.w * this.split}px`, top: `${p.y}px`, height: `${p.h}px` });
    const name = side => this.frame[side] ? `${this.frame[side].integrator}${this.frame[side].samples > 0 ? `, ${this.frame[side].samples} spp` : ""}` : "";
    get("label-a").hidden = !b || mode === "b" || mode === "errors";
    get("label-b").hidden = !b || mode === "a";
    get("label-a").textContent = `A ${name("a")}${asked !== mode ? ": A and B differ in size, so there are no errors" : ""}`;
    get("label-b").textContent = mode === "errors" ? `|A - B| / (B + 0.01), white: ${short(this.state ? this.state.most_error : 0.5)}` : `B ${name("b")}`;
  }

  statistics() {
    const f = this.frame, between = (this.times.at(-1) - this.times[0]) / Math.max(1, this.times.length - 1);
    const rows = [["picture", `${f.width} x ${f.height}${f.moving ? ", moving" : ""}`], ["samples a pixel", f.b ? `${f.a.samples}, ${f.b.samples}` : f.a.samples],
      ...Object.entries(f.ms).map(([stage, ms]) => [`ms ${stage}`, ms.toFixed(1)]),
      ["frames", this.times.length > 1 ? `${(1000 / between).toFixed(1)} /s` : ""], ["queries", rate(f.a.queries_per_s + (f.b ? f.b.queries_per_s : 0))],
      ["rays", rate(f.a.rays_per_s + (f.b ? f.b.rays_per_s : 0))], ["memory", bytes(f.memory)],
      ["viewers", this.state ? this.state.clients : ""]];
    get("statistics").replaceChildren(...rows.map(row => element("tr", {}, ...row.map(cell => element("td", {}, String(cell))))));
    this.showRole();
  }

  showRole() {
    const f = this.frame, role = this.controls ? "" : "watching · ";
    if (f && this.state) get("status").textContent = `${role}${f.a.integrator} ${f.width} x ${f.height}, ${f.a.samples} spp`;
  }

  // --- the panel

  build() {
    const on = (id, event, action) => get(id).addEventListener(event, action);
    const side = (name, change) => this.set({ [name]: change });
    on("integrator-a", "change", event => side("a", { integrator: event.target.value }));
    on("model-a", "change", event => this.changeModel("a", +event.target.value));
    on("integrator-b", "change", event => {
      side("b", event.target.value ? { integrator: event.target.value } : null);
      if (event.target.value === "stored") this.goToStored();
    });
    on("model-b", "change", event => this.changeModel("b", +event.target.value));
    on("layer", "change", event => this.set({ layer: event.target.value }));
    on("size", "change", event => {
      const [width, height] = event.target.value.split("x").map(Number);
      this.set({ width, height });
    });
    on("full", "change", event => this.set({ full: event.target.checked }));
    on("most", "change", event => this.set({ most_error: +event.target.value }));
    on("exposure", "input", event => this.set({ exposure: +event.target.value }));
    on("curve", "change", event => this.set({ curve: event.target.value }));
    on("white-pick", "click", () => this.arm(this.clicks === "white" ? null : "white"));
    on("white-reset", "click", () => this.set({ white: [1, 1, 1] }));
    on("fov", "input", event => { this.camera.fov = +event.target.value; this.moved(); this.show(); });
    on("speed", "input", event => { this.speed = +event.target.value; this.show(); });
    on("inspect", "click", () => this.arm(this.clicks === "inspect" ? null : "inspect"));
    on("control", "click", () => this.send({ type: this.controls ? "release" : "take" }));
    on("help-open", "click", () => get("help").showModal());
    on("panel-toggle", "click", () => this.togglePanel());
    on("pose-save", "click", () => { this.pose_list.push(copyOf(this.camera)); this.remember(); });
    on("camera-save", "click", () => saveFile("camera.json", JSON.stringify(this.camera, null, 1)));
    on("camera-load", "click", () => get("camera-file").click());
    on("camera-file", "change", async event => {
      const [file] = event.target.files;
      event.target.value = "";
      try {
        if (!file) return;
        const camera = { up: [0, 1, 0], ...JSON.parse(await file.text()) };
        if (camera.type !== "orthographic") camera.fov ??= 45;
        for (const key of ["origin", "target", "up"]) if (camera[key].length !== 3 || !camera[key].every(Number.isFinite)) throw new Error(key);
        this.go(camera);
      } catch {
        this.say(`${file.name}: not a camera with origin and target`, true);
      }
    });
    on("command", "click", () => this.copyCommand());
    on("key-add", "click", () => this.addKey());
    on("key-play", "click", () => this.preview());
    on("key-export", "click", () => saveFile("path.json", JSON.stringify(this.path(), null, 1)));
    on("key-clear", "click", () => { this.keys = []; this.remember(); });
    for (const button of document.querySelectorAll("[data-mode]")) button.addEventListener("click", () => this.compare(button.dataset.mode));
    for (const button of document.querySelectorAll("[data-drive]")) button.addEventListener("click", () => this.setDrive(button.dataset.drive));
    for (const button of document.querySelectorAll("[data-save]")) button.addEventListener("click", () => this.savePicture(button.dataset.save));
    if (matchMedia("(max-width: 700px)").matches) this.togglePanel();
    new ResizeObserver(() => this.draw()).observe(stage);
    setInterval(() => this.checkConnection(), 5000);
  }

  togglePanel() {
    const hidden = get("panel").hidden = !get("panel").hidden;
    get("panel-toggle").setAttribute("aria-expanded", String(!hidden));
  }

  setDrive(drive) {
    this.drive = drive;
    if (drive === "orbit" && !this.pivot && this.controls) this.findPivot();
    this.show();
  }

  changeModel(side, model) {
    const now = this.state[side].integrator, own = this.hello.models[model].integrators;
    this.set({ [side]: { model, integrator: own.includes(now) || this.hello.integrators.includes(now) ? now : own[0] } });
  }

  compare(mode) {
    this.mode = mode;
    if (this.controls && this.state.b && this.state.errors !== (mode === "errors")) this.set({ errors: mode === "errors" });
    this.show();
    this.draw();
  }

  toggleCompare() {
    const other = this.hello.models.length > 0 && this.state.a.integrator === "path" ? this.hello.models[0].integrators[0] : "path";
    this.set({ b: this.state.b ? null : { integrator: other } });
  }

  arm(what) {
    this.clicks = what;
    get("inspect").setAttribute("aria-pressed", String(what === "inspect"));
    get("white-pick").setAttribute("aria-pressed", String(what === "white"));
    canvas.classList.toggle("inspecting", !!what);
    get("hint").textContent = what === "white" ? "click on what should be white" : what ? "click on a pixel" : "";
  }

  // What there is to choose from, once for a connection.
  offer() {
    const { hello } = this;
    document.title = `octrad view: ${hello.scene}`;
    get("title").textContent = hello.scene.split("/").slice(-2).join("/");
    get("title").title = `${hello.scene}, octrad ${hello.version}`;
    const models = () => hello.models.map((m, i) => element("option", { value: i }, `${i + 1} ${m.file.split("/").at(-1)}`));
    for (const id of ["model-a", "model-b"]) get(id).replaceChildren(...models());
    for (const label of document.querySelectorAll("label.models")) label.hidden = hello.models.length < 2;
    get("layer").replaceChildren(element("option", { value: "" }, "radiance"), ...hello.layers.map(l => element("option", { value: l }, l)));
    get("sensors").replaceChildren(...hello.sensors.map((camera, i) => {
      const button = element("button", { type: "button", title: i < 9 ? `key ${i + 1}` : "" }, `Sensor ${i}`);
      button.addEventListener("click", () => this.go(camera));
      return button;
    }));
    try {
      const kept = JSON.parse(localStorage.getItem(`octrad ${hello.scene}`)) || {};
      this.pose_list = kept.poses || [];
      this.keys = kept.keys || [];
    } catch { /* nothing was kept */ }
    this.lists();
  }

  remember() {
    try {
      localStorage.setItem(`octrad ${this.hello.scene}`, JSON.stringify({ poses: this.pose_list, keys: this.keys }));
    } catch { /* a browser that keeps nothing */ }
    this.lists();
  }

  lists() {
    const buttons = (poses, name) => poses.flatMap((camera, i) => {
      const go = element("button", { type: "button" }, `${name} ${i + 1}`), drop = element("button", { type: "button", title: `drop ${name} ${i + 1}` }, "×");
      go.addEventListener("click", () => this.go(camera));
      drop.addEventListener("click", () => { poses.splice(i, 1); this.remember(); });
      return [go, drop];
    });
    get("poses").replaceChildren(...buttons(this.pose_list, "Pose"));
    get("keys").replaceChildren(...buttons(this.keys, "Key"));
  }

  // The panel as the state is.
  show() {
    const { state, hello } = this;
    const control = get("control");
    control.hidden = !state || (!this.controls && state.controller !== 0) || (this.controls && state.clients < 2);
    control.textContent = this.controls ? "Release controls" : "Take controls";
    for (const field of document.querySelectorAll("#panel select, #panel input, #panel button")) field.disabled = !this.controls && !field.matches("#speed, #inspect, #camera-save, #command, [data-save], [data-mode]:not([data-mode=errors])");
    if (hello && hello.training) this.training.enable();
    if (!state || !hello) return;
    const options = (names, none) => [...(none ? [element("option", { value: "" }, none)] : []),
      ...names.map(n => element("option", { value: n, title: hello.summaries[n.replace(/\d+$/, "")] || "" }, n))];
    const names = side => [...hello.integrators, ...(hello.models.length > 0 ? hello.models[side ? side.model : 0].integrators : [])];
    get("integrator-a").replaceChildren(...options(names(state.a)));
    get("integrator-a").value = state.a.integrator;
    get("integrator-b").replaceChildren(...options([...names(state.b || state.a), ...(hello.stored ? ["stored"] : [])], "nothing"));
    get("integrator-b").value = state.b ? state.b.integrator : "";
    get("model-a").value = state.a.model;
    get("model-b").value = state.b ? state.b.model : 0;
    for (const part of document.querySelectorAll(".compared")) part.hidden = !state.b || (part.classList.contains("models") && hello.models.length < 2);
    get("layer").value = state.layer;
    const first = state.width / state.height, { least_size: least, largest_size: largest } = hello.limits;
    const sizes = [320, 480, 640, 960, 1280, 1920].map(w => [w, Math.round(w / first)]);
    if (!sizes.some(([w]) => w === state.width)) sizes.push([state.width, state.height]);
    get("size").replaceChildren(...sizes.filter(([w, h]) => h >= least && h <= largest).sort((a, b) => a[0] - b[0]).map(([w, h]) => {
      const height = w === state.width ? state.height : h;
      return element("option", { value: `${w}x${height}` }, `${w} x ${height}`);
    }));
    get("size").value = `${state.width}x${state.height}`;
    get("full").checked = state.full;
    get("exposure").value = state.exposure;
    get("exposure-value").textContent = `${state.exposure > 0 ? "+" : ""}${state.exposure.toFixed(1)}`;
    get("curve").value = state.curve;
    if (document.activeElement !== get("most")) get("most").value = state.most_error;
    const camera = this.camera || state.camera;
    if (!camera.fov) get("fov").disabled = true;  // orthographic
    get("fov").value = camera.fov || 45;
    get("fov-value").textContent = camera.fov ? `${camera.fov.toFixed(0)}°` : "–";
    get("speed").value = this.speed;
    get("speed-value").textContent = `${short(this.pace())} /s`;
    for (const button of document.querySelectorAll("[data-drive]")) button.setAttribute("aria-pressed", String(button.dataset.drive === this.drive));
    for (const button of document.querySelectorAll("[data-mode]")) button.setAttribute("aria-pressed", String(button.dataset.mode === this.mode));
    this.draw();
  }

  // --- what is asked

  async inspect(at) {
    const found = await this.ask({ type: "pick", side: this.mode === "b" || (this.mode === "split" && this.state.b && at.x > this.split) ? "b" : "a", ...at });
    if (!found) return;
    this.inspected = found;
    const color = rgb => {
      const swatch = element("span", { class: "swatch" });
      swatch.style.background = `rgb(${rgb.map(v => Math.round(255 * clamp(v, 0, 1) ** (1 / 2.2))).join(" ")})`;
      return [swatch, list(rgb)];
    };
    const rows = [];
    const row = (name, ...value) => rows.push(element("tr", {}, element("td", {}, name), element("td", {}, ...value)));
    for (const [side, pixel] of Object.entries(found.pixels)) row(`pixel ${side.toUpperCase()}`, ...color(pixel.radiance), ` ${pixel.integrator}, ${pixel.samples} spp, at ${pixel.pixel.join(", ")}`);
    if (found.hit) {
      row("point", list(found.position));
      row("distance", short(found.distance));
      row("shape", found.shape || "–");
      row("material", found.material || "–");
      row("normal", list(found.normal));
      row("albedo", ...color(found.albedo));
      row("roughness", short(found.roughness));
    } else {
      row("surface", "none");
    }
    if (found.emitted && found.emitted.some(v => v > 0)) row("emitted", ...color(found.emitted));
    for (const query of found.queries || []) {
      row("radiance asked", ...color(query.radiance));
      row("direction", list(query.direction));
      row("disparity", short(query.disparity));
      query.features.forEach((features, level) => row(`features ${level + 1}`, list(features)));
    }
    get("inspected").replaceChildren(element("table", {}, ...rows));
    this.training.choose(found.material_number);
    if (get("panel").hidden) this.togglePanel();
    get("inspected").scrollIntoView({ block: "nearest" });
  }

  async white(at) {
    const found = await this.ask({ type: "pick", ...at });
    if (!found) return;
    const { pixels } = found, rgb = pixels.a ? pixels.a.radiance : [0, 0, 0];
    if (Math.min(...rgb) <= 0) return this.say("That pixel has no colour that could be white.", true);
    this.set({ white: rgb.map(v => clamp(luminance(rgb) / v, 0.01, 100)) });
    this.arm(null);
  }

  async savePicture(name) {
    try {
      const answer = await fetch(`/picture-${name}?token=${encodeURIComponent(token)}`);
      if (!answer.ok) throw new Error(await answer.text());
      saveFile(`view-${name}`, await answer.blob());
    } catch (error) {
      this.say(String(error.message), true);
    }
  }

  commandLine(side = "a") {
    const { command } = this.hello, { integrator, model } = this.state[side], c = this.camera;
    const asks = !this.hello.integrators.includes(integrator);
    const words = ["octrad", "render", command.scene, "--integrator", integrator];
    if (asks) words.push("--model", this.hello.models[model].file);
    if (asks && command.force) words.push("--force");
    if (command.permissive) words.push("--permissive");
    if (!asks && command.max_depth !== undefined) words.push("--max-depth", String(command.max_depth));
    for (const d of [...command.definitions, ...(asks ? command.model_definitions : [])]) words.push("-D", d);
    if (command.seed !== undefined) words.push("--seed", String(command.seed));
    // Other cameras than perspective ones have no options, and options mirror and clip as the first sensor does: what
    // Save JSON writes is named.
    const first = this.hello.sensors[0], other = key => c[key] !== undefined && c[key] !== first[key];
    if ((c.type && c.type !== "perspective") || !c.mirrored !== !first.mirrored || other("near_clip") || other("far_clip")) words.push("--camera", "camera.json");
    else words.push(`--origin=${c.origin}`, `--target=${c.target}`, `--up=${c.up}`, "--fov", String(c.fov), "--fov-axis", c.fov_axis || "x");
    words.push("--width", String(this.state.width), "--height", String(this.state.height), "--spp", String(this.frame ? this.frame[side].samples : 4), "-o", "view.exr");
    return words.map(quoted).join(" ");
  }

  async copyCommand() {
    const text = get("command-text");
    text.value = this.commandLine();
    text.hidden = false;
    text.select();
    try {
      await navigator.clipboard.writeText(text.value);
      this.say("Copied." + (this.hello.training ? " It renders the model as it was saved last, and the scene of the file." : ""), true);
    } catch { /* it is there to be copied by hand */ }
  }

  addKey() {
    this.keys.push(copyOf(this.camera));
    this.remember();
  }

  path() { return { keys: this.keys, duration: +get("duration").value, fps: +get("fps").value }; }

  preview() {
    if (this.keys.length < 2) return this.say("A camera path needs two keys or more.", true);
    this.send({ type: "path", ...this.path() });
  }

  // --- mouse, touch, keyboard

  listen() {
    const angle = pixels => 2 * Math.atan(tangentX(this.camera, this.place().w / this.place().h)) * pixels / Math.max(1, this.place().w);
    canvas.addEventListener("pointerdown", event => {
      canvas.focus();
      if (this.pointers.size === 0 && event.button === 0 && (this.clicks || event.altKey) && this.state) {
        const at = this.at(event);
        if (at && this.clicks === "white") this.white(at);
        else if (at) this.inspect(at);
        if (at && this.clicks === "inspect") this.arm(null);
        return;
      }
      try { canvas.setPointerCapture(event.pointerId); } catch { /* a pointer of a test */ }
      this.pointers.set(event.pointerId, { x: event.clientX, y: event.clientY, other: event.button === 2 });
      if (this.controls && (this.drive === "orbit") !== (event.button === 2) && !this.pivot) this.findPivot();
    });
    canvas.addEventListener("pointermove", event => {
      const before = this.pointers.get(event.pointerId);
      if (!before || !this.controls) return;
      const dx = event.clientX - before.x, dy = event.clientY - before.y;
      if (this.pointers.size === 2) {
        const [p, q] = [...this.pointers.values()], apart = Math.hypot(p.x - q.x, p.y - q.y);
        Object.assign(before, { x: event.clientX, y: event.clientY });
        const closer = Math.hypot(p.x - q.x, p.y - q.y) - apart, unit = this.pace() / 150;
        this.shift(-dx * unit / 2, dy * unit / 2, closer * unit);
        this.pivot = null;
        return;
      }
      Object.assign(before, { x: event.clientX, y: event.clientY });
      const sign = event.pointerType === "touch" ? -1 : 1;
      if ((this.drive === "orbit") !== before.other) this.orbit(4 * angle(dx), -4 * angle(dy));
      else this.look(sign * angle(dx), -sign * angle(dy));
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, event => this.pointers.delete(event.pointerId));
    canvas.addEventListener("contextmenu", event => event.preventDefault());
    canvas.addEventListener("dblclick", event => {
      const at = this.at(event);
      if (at && this.controls) this.lookAt(at);
    });
    canvas.addEventListener("wheel", event => {
      event.preventDefault();
      const steps = -clamp(event.deltaY, -100, 100) / 100;
      if (this.drive === "fly") {
        this.speed = clamp(this.speed + 0.5 * steps, -6, 6);
        this.show();
        get("hint").textContent = `speed ${short(this.pace())} units a second`;
        clearTimeout(this.hinted);
        this.hinted = setTimeout(() => this.arm(this.clicks), 1500);
      } else if (this.controls) {
        const pivot = this.pivot || add(this.camera.origin, axes(this.camera).forward, 0.5 * this.hello.radius);
        this.shift(0, 0, length(subtract(pivot, this.camera.origin)) * (1 - 0.85 ** steps));
      }
    }, { passive: false });
    const divider = get("divider");
    divider.addEventListener("keydown", event => {
      const step = { ArrowLeft: -0.02, ArrowRight: 0.02 }[event.key];
      if (!step) return;
      this.split = clamp(this.split + step, 0.02, 0.98);
      this.draw();
    });
    divider.addEventListener("pointerdown", event => divider.setPointerCapture(event.pointerId));
    divider.addEventListener("pointermove", event => {
      if (!divider.hasPointerCapture(event.pointerId)) return;
      const p = this.place(), box = canvas.getBoundingClientRect();
      this.split = clamp((event.clientX - box.left - p.x) / p.w, 0.02, 0.98);
      this.draw();
    });
    const moves = ["KeyW", "KeyA", "KeyS", "KeyD", "KeyQ", "KeyE", "ShiftLeft", "ShiftRight"];
    document.addEventListener("keydown", event => {
      // Sliders, boxes and colours take no letters.
      const typed = "input:not([type=range], [type=checkbox], [type=color]), select, textarea, dialog";
      if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest(typed)) return;
      if (moves.includes(event.code)) {
        this.held.add(event.code);
        if (event.code.startsWith("Key")) this.playing = null;
        return;
      }
      if (event.repeat && !["[", "]"].includes(event.key)) return;
      this.key(event);
    });
    document.addEventListener("keyup", event => this.held.delete(event.code));
    window.addEventListener("blur", () => this.held.clear());
  }

  key(event) {
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;  // Shift is for speed
    if (key === "?" || key === "h") return get("help").showModal();
    if (key === "m") return this.togglePanel();
    if (key === "i") return this.arm(this.clicks === "inspect" ? null : "inspect");
    if (key === "Escape") { this.playing = null; return this.arm(null); }
    if (key === "f" && this.state && this.state.b) return this.compare(this.mode === "a" ? "b" : "a");
    if (!this.controls) return;
    if (key === "o") this.setDrive(this.drive === "fly" ? "orbit" : "fly");
    else if (key === "c") this.toggleCompare();
    else if (key === "x" && this.state.b) this.compare(this.mode === "errors" ? "split" : "errors");
    else if (key === "k") this.addKey();
    else if (key === "p") this.preview();
    else if (key === "[" || key === "]") this.set({ exposure: clamp(this.state.exposure + (key === "]" ? 0.25 : -0.25), -20, 20) });
    else if (/^[1-9]$/.test(key) && this.hello.sensors[key - 1]) this.go(this.hello.sensors[key - 1]);
  }
}

window.viewer = new Viewer();
