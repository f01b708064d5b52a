// The ground, which does not change: the floor, areas, canals and walls.

import { FAINT, GROUND, INK, type Backdrop, type Playback } from "./playback";
import type { View } from "./view";

type Pen = CanvasRenderingContext2D;

/** Draw the floor and the areas on it. */
export function drawGround(pen: Pen, playback: Playback, view: View): void {
  const [x0, y0, x1, y1] = playback.bounds;
  pen.fillStyle = GROUND;
  pen.fillRect(view.x(x0), view.y(y1), view.scale * (x1 - x0), view.scale * (y1 - y0));
  for (const part of playback.backdrop) {
    if (part.shape === "raster") drawRaster(pen, part, view);
    else drawShape(pen, part, view);
  }
  pen.strokeStyle = FAINT;
  pen.lineWidth = 1;
  pen.strokeRect(view.x(x0), view.y(y1), view.scale * (x1 - x0), view.scale * (y1 - y0));
}

/** Write the names of areas; nothing else may hide them. */
export function drawLabels(pen: Pen, playback: Playback, view: View): void {
  for (const part of playback.backdrop) {
    if (part.label && part.fill && part.shape === "rect") drawLabel(pen, part, view);
  }
}

function drawShape(pen: Pen, part: Backdrop, view: View): void {
  const [a, b, c, d] = part.numbers as [number, number, number, number];
  pen.beginPath();
  if (part.shape === "disc")
    pen.arc(view.x(a), view.y(b), Math.abs(view.scale * c), 0, 2 * Math.PI);
  else pen.rect(view.x(a), view.y(d), view.scale * (c - a), view.scale * (d - b));
  if (part.fill) {
    pen.fillStyle = part.fill;
    pen.fill();
  }
  if (part.line) {
    pen.strokeStyle = part.line;
    pen.lineWidth = 1;
    pen.stroke();
  }
}

function drawRaster(pen: Pen, part: Backdrop, view: View): void {
  const cells = part.cells!;
  const [rows, columns] = cells.shape as [number, number];
  if (!rows || !columns || !part.fill) return;
  const image = new ImageData(columns, rows);
  const rgb = parseInt(part.fill.slice(1), 16);
  for (let row = 0; row < rows; row++) {
    for (let column = 0; column < columns; column++) {
      if (!cells.at(row, column)) continue;
      // Row 0 of the cells is the lowest, row 0 of the image the highest.
      const at = 4 * ((rows - 1 - row) * columns + column);
      image.data.set([rgb >> 16, (rgb >> 8) & 255, rgb & 255, 255], at);
    }
  }
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [columns, rows];
  canvas.getContext("2d")!.putImageData(image, 0, 0);
  const [x0, y0, x1, y1] = part.numbers as [number, number, number, number];
  pen.imageSmoothingEnabled = false;
  pen.drawImage(canvas, view.x(x0), view.y(y1), view.scale * (x1 - x0), view.scale * (y1 - y0));
}

function drawLabel(pen: Pen, part: Backdrop, view: View): void {
  const [left, , , top] = part.numbers as [number, number, number, number];
  const [x, y] = [view.x(left) + 4, view.y(top) + 10];
  pen.font = "11px system-ui, sans-serif";
  pen.textAlign = "left";
  pen.textBaseline = "middle";
  // A light rim keeps names readable on any ground.
  pen.strokeStyle = GROUND;
  pen.lineWidth = 3;
  pen.globalAlpha = 0.8;
  pen.strokeText(part.label, x, y);
  pen.fillStyle = INK;
  pen.fillText(part.label, x, y);
  pen.globalAlpha = 1;
}
