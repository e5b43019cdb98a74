// What the viewer needs and that knows nothing of it: vectors, cameras, elements, files.
export const add = (a, b, s = 1) => [a[0] + b[0] * s, a[1] + b[1] * s, a[2] + b[2] * s];
export const subtract = (a, b) => add(a, b, -1);
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const length = a => Math.hypot(...a);
export const normalize = a => { const l = length(a) || 1; return a.map(v => v / l); };
// Of linear sRGB (Rec. 709 primaries), as luminance() of src/octrad/base/vec.h.
export const luminance = a => 0.212671 * a[0] + 0.71516 * a[1] + 0.072169 * a[2];
export const clamp = (v, low, high) => Math.min(Math.max(v, low), high);

// About a unit axis (Rodrigues).
export function rotate(v, axis, angle) {
  const c = Math.cos(angle), s = Math.sin(angle);
  return add(add(v.map(x => x * c), cross(axis, v), s), axis, dot(axis, v) * (1 - c));
}

// The directions of a camera as `render --camera` takes it, with the horizon level. hand: -1 where left and right of
// the picture are exchanged.
export function axes(camera) {
  const forward = normalize(subtract(camera.target, camera.origin)), vertical = normalize(camera.up);
  const side = normalize(cross(forward, vertical)), hand = camera.mirrored ? -1 : 1;
  return { forward, right: side.map(v => v * hand), up: cross(side, forward), vertical, hand };
}

// The direction turned by angles to the right and upwards; it stays off the vertical.
export function turned(forward, vertical, right, upwards) {
  const level = rotate(forward, vertical, -right);
  const now = Math.asin(clamp(dot(level, vertical), -1, 1));
  const angle = clamp(now + upwards, -1.54, 1.54) - now;
  return normalize(rotate(level, normalize(cross(level, vertical)), angle));
}

// Half the angle of view along x as a tangent, for a picture of this aspect.
export function tangentX(camera, aspect) {
  if (!camera.fov) return 0.5;  // orthographic: there is none
  const tangent = Math.tan(camera.fov * Math.PI / 360), axis = camera.fov_axis || "x";
  if (axis === "diagonal") return tangent / Math.sqrt(1 + 1 / (aspect * aspect));
  const alongY = axis === "y" || (axis === "smaller" && aspect > 1) || (axis === "larger" && aspect < 1);
  return alongY ? tangent * aspect : tangent;
}

export const copyOf = camera => JSON.parse(JSON.stringify(camera));

export function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

export function saveFile(name, content) {
  const link = element("a", { download: name });
  link.href = URL.createObjectURL(content instanceof Blob ? content : new Blob([content], { type: "application/json" }));
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

export const short = v => Number.isInteger(v) ? String(v) : (v !== 0 && Math.abs(v) < 1e-3 ? v.toExponential(2) : String(+v.toPrecision(4)));
export const list = v => v.map(short).join(" ");

export function bytes(n) {
  for (const unit of ["B", "KiB", "MiB"]) {
    if (n < 1024) return `${n.toFixed(unit === "B" ? 0 : 1)} ${unit}`;
    n /= 1024;
  }
  return `${n.toFixed(2)} GiB`;
}

export const rate = n => n >= 1e6 ? `${(n / 1e6).toFixed(2)} M/s` : n >= 1e3 ? `${(n / 1e3).toFixed(0)} k/s` : `${n.toFixed(0)} /s`;

// A word of a command line of a POSIX shell.
export const quoted = word => /^[\w@%+=:,./-]+$/.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`;
