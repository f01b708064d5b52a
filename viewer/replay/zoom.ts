// Zooming: the wheel zooms at the pointer, dragging moves; all worlds follow.

import type { Store } from "./state";
import type { View } from "./view";

const MOST = 30;
/** Smallest movement of a drag, in pixels; less is a click. */
const SLACK = 4;

/** Let a canvas be zoomed and moved. Clicks that end a drag do not reach its other listeners. */
export function letZoom(canvas: HTMLCanvasElement, view: View, store: Store): void {
  canvas.addEventListener(
    "wheel",
    (event) => {
      // In a page that scrolls the wheel is for scrolling.
      const { scrollHeight, clientHeight } = document.documentElement;
      if (scrollHeight > clientHeight && !event.ctrlKey) return;
      event.preventDefault();
      const [x, y] = view.at(event.offsetX, event.offsetY);
      zoom(store, Math.exp(-0.002 * event.deltaY), x, y);
    },
    { passive: false },
  );

  let from: { x: number; y: number } | null = null;
  let isDrag = false;
  canvas.addEventListener("pointerdown", (event) => {
    isDrag = false;
    const isZoomed = store.now.look.zoom > 1;
    from = isZoomed && !event.button ? { x: event.clientX, y: event.clientY } : null;
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!from || !(event.buttons & 1)) return;
    const [dx, dy] = [event.clientX - from.x, event.clientY - from.y];
    if (!isDrag && Math.hypot(dx, dy) < SLACK) return;
    if (!isDrag) canvas.setPointerCapture(event.pointerId);
    isDrag = true;
    from = { x: event.clientX, y: event.clientY };
    const { look } = store.now;
    store.set({ look: { ...look, x: look.x - dx / view.scale, y: look.y + dy / view.scale } });
  });
  canvas.addEventListener("click", (event) => isDrag && event.stopImmediatePropagation(), true);
}

/** Zoom by a factor, with a point of the world fixed on the canvas. */
export function zoom(store: Store, factor: number, x: number, y: number): void {
  const { look } = store.now;
  const next = Math.min(Math.max(look.zoom * factor, 1), MOST);
  const part = look.zoom / next;
  store.set({ look: { zoom: next, x: x + (look.x - x) * part, y: y + (look.y - y) * part } });
}
