// Which part of the world a scene shows. Pure functions of an immutable camera.

export const WHOLE = {zoom: 1, x: null, y: null};   // x, y: centre [m]; null: that of the map
const FARTHEST = 0.5, NEAREST = 60;

// Conversion of metres to pixels of the canvas. base: that into which the whole map is fitted.
export function seen(base, camera, width, height) {
  if (camera.x === null) return {...base, scale: base.scale * camera.zoom,
    ox: width / 2 + (base.ox - width / 2) * camera.zoom, oy: height / 2 + (base.oy - height / 2) * camera.zoom};
  const scale = base.scale * camera.zoom;
  return {...base, scale, ox: width / 2 - scale * camera.x, oy: height / 2 + scale * camera.y};
}

const centre = (f, width, height) => ({x: (width / 2 - f.ox) / f.scale, y: (f.oy - height / 2) / f.scale});

// Zoomed by a factor so that the place under a pixel (u, v) of the canvas stays there.
export function zoomed(camera, f, factor, u, v, width, height) {
  const zoom = Math.min(NEAREST, Math.max(FARTHEST, camera.zoom * factor)), k = camera.zoom / zoom;
  const middle = centre(f, width, height), x = (u - f.ox) / f.scale, y = (f.oy - v) / f.scale;
  return {zoom, x: x + (middle.x - x) * k, y: y + (middle.y - y) * k};
}

// Moved by pixels of the canvas.
export function panned(camera, f, du, dv, width, height) {
  const middle = centre(f, width, height);
  return {zoom: camera.zoom, x: middle.x - du / f.scale, y: middle.y + dv / f.scale};
}
