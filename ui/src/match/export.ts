/** The drawing as a file: SVG, or PNG at twice the size of the screen. */

import { CanvasPainter, type Painter, SvgPainter } from "../draw/painter";
import type { Palette } from "../draw/palette";
import type { Size, View } from "../draw/view";
import { drawOverlay, type Shown } from "./draw-overlay";
import type { Overlay } from "./overlay";

export interface Sheet {
  readonly overlay: Overlay;
  readonly view: View;
  readonly size: Size;
  readonly palette: Palette;
  readonly shown: Shown;
  /** Lines of text above the drawing, the first one large. */
  readonly lines: readonly string[];
}

const HEAD = 28;
const LINE = 20;
const PIXELS = 2;

export function svgOf(sheet: Sheet): string {
  const painter = new SvgPainter();
  const height = drawSheet(painter, sheet, (top, draw) => {
    const inner = new SvgPainter();
    draw(inner);
    const { width, height } = sheet.size;
    painter.embed(0, top, inner.document(width, height, sheet.lines[0] ?? ""));
  });
  return painter.document(sheet.size.width, height, sheet.lines[0] ?? "");
}

export function pngOf(sheet: Sheet): Promise<Blob> {
  const canvas = document.createElement("canvas");
  canvas.width = sheet.size.width * PIXELS;
  canvas.height = heightOf(sheet) * PIXELS;
  const context = canvas.getContext("2d");
  if (context === null) return Promise.reject(new Error("The browser cannot draw the picture."));
  context.scale(PIXELS, PIXELS);
  drawSheet(new CanvasPainter(context), sheet, (top, draw) => {
    context.save();
    context.translate(0, top);
    draw(new CanvasPainter(context));
    context.restore();
  });
  return new Promise((resolve, reject) => {
    canvas.toBlob((blob) => (blob ? resolve(blob) : reject(new Error("The browser cannot write the picture."))));
  });
}

/** Has the browser save a file. */
export function save(blob: Blob, name: string): void {
  const url = URL.createObjectURL(blob);
  const link = document.createElement("a");
  link.href = url;
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}

function heightOf(sheet: Sheet): number {
  return sheet.size.height + HEAD + sheet.lines.length * LINE;
}

/** Draws text and, through `place`, the picture below it. Returns the height of all. */
function drawSheet(painter: Painter, sheet: Sheet, place: (top: number, draw: (painter: Painter) => void) => void): number {
  const { palette, size, lines } = sheet;
  painter.rectangle(0, 0, size.width, heightOf(sheet), { fill: palette.paper });
  lines.forEach((line, at) => {
    painter.text(16, HEAD + at * LINE, line, { size: at ? 12 : 16, fill: at ? palette.soft : palette.ink, bold: at === 0 });
  });
  const top = HEAD + lines.length * LINE;
  place(top, (inner) => drawOverlay(inner, sheet.overlay, sheet.view, size, palette, sheet.shown));
  return heightOf(sheet);
}
