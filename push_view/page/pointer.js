// Mouse, pen and fingers on a scene. One finger or the left button uses the chosen tool; the wheel, two
// fingers, or another button move the picture.

const STEP = 1.0015;   // zoom per unit of the wheel

export class Pointer {
  // tools: by name {down, move, up, cancel}, each called with (metres, pixel), cancel without;
  // tool(): name of the chosen one, "pan" for none; model(): the model; soon(): draw again;
  // hover(metres): where the pointer is, null when it has left
  constructor(canvas, scene, {tools, tool, model, soon, hover = () => {}}) {
    Object.assign(this, {canvas, scene, tools, tool, model, soon, hover});
    this.touching = new Map(); this.using = null; this.panning = false;
    canvas.onpointerdown = event => this.down(event);
    canvas.onpointermove = event => this.move(event);
    canvas.onpointerup = event => this.up(event);
    canvas.onpointercancel = event => this.lost(event);
    canvas.onpointerleave = () => this.hover(null);
    canvas.oncontextmenu = event => event.preventDefault();
    canvas.addEventListener("wheel", event => {
      event.preventDefault();
      scene.zoom(model(), STEP ** -event.deltaY, scene.place(model(), event).pixel); soon();
    }, {passive: false});
  }

  down(event) {
    this.touching.set(event.pointerId, event);
    this.canvas.setPointerCapture(event.pointerId);
    if (this.touching.size > 1) { this.cancel(); this.panning = true; return; }
    this.panning = event.button !== 0 || !this.tools[this.tool()];
    if (this.panning) return;
    const {metres, pixel} = this.scene.place(this.model(), event);
    this.using = this.tools[this.tool()].down(metres, pixel) === false ? null : this.tools[this.tool()];
    this.soon();
  }

  move(event) {
    const {metres, pixel} = this.scene.place(this.model(), event);
    this.hover(metres);
    const before = this.touching.get(event.pointerId);
    if (!before) return;
    if (this.panning) this.shift(event);
    else this.using?.move(metres, pixel);
    this.touching.set(event.pointerId, event);
    this.soon();
  }

  // One pointer pans; two zoom about their middle as well.
  shift(event) {
    const before = this.touching.get(event.pointerId), many = this.touching.size;
    this.scene.pan(this.model(), (event.clientX - before.clientX) / many, (event.clientY - before.clientY) / many);
    if (many !== 2) return;
    const [other] = [...this.touching].filter(([id]) => id !== event.pointerId).map(([, e]) => e);
    const apart = e => Math.hypot(e.clientX - other.clientX, e.clientY - other.clientY);
    const box = this.canvas.getBoundingClientRect();
    const middle = {x: (event.clientX + other.clientX) / 2 - box.left, y: (event.clientY + other.clientY) / 2 - box.top};
    if (apart(before) > 5) this.scene.zoom(this.model(), apart(event) / apart(before), middle);
  }

  up(event) {
    this.touching.delete(event.pointerId);
    const {metres, pixel} = this.scene.place(this.model(), event), using = this.using;
    this.using = null;
    if (!this.panning) using?.up(metres, pixel);
    if (!this.touching.size) this.panning = false;
    this.soon();
  }

  lost(event) { this.touching.delete(event.pointerId); this.cancel(); this.panning = this.touching.size > 0; this.soon(); }

  cancel() { this.using?.cancel(); this.using = null; }
}
