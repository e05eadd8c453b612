/** What a drawing is made with: the same calls paint on a canvas and write SVG, so an export looks like the screen. */

export interface Style {
  readonly fill?: string | undefined;
  readonly stroke?: string | undefined;
  readonly width?: number;
  readonly dash?: readonly number[];
  readonly opacity?: number;
}

export interface TextStyle {
  readonly size: number;
  readonly fill: string;
  readonly anchor?: "start" | "middle" | "end";
  readonly bold?: boolean;
}

/** Coordinates are pixels, y down. */
export interface Painter {
  circle(x: number, y: number, radius: number, style: Style): void;
  /** A line through points, [x0, y0, x1, y1, ...]; `closed` joins its ends. */
  line(points: ArrayLike<number>, style: Style, closed?: boolean): void;
  text(x: number, y: number, text: string, style: TextStyle): void;
  rectangle(x: number, y: number, width: number, height: number, style: Style): void;
  /** Draws only inside of a rectangle while `draw` runs. */
  clipped(x: number, y: number, width: number, height: number, draw: () => void): void;
}

const FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, sans-serif";

export class CanvasPainter implements Painter {
  constructor(private readonly context: CanvasRenderingContext2D) {}

  circle(x: number, y: number, radius: number, style: Style): void {
    this.context.beginPath();
    this.context.arc(x, y, radius, 0, 2 * Math.PI);
    this.finish(style);
  }

  line(points: ArrayLike<number>, style: Style, closed = false): void {
    this.context.beginPath();
    for (let at = 0; at + 1 < points.length; at += 2) {
      if (at === 0) this.context.moveTo(points[0]!, points[1]!);
      else this.context.lineTo(points[at]!, points[at + 1]!);
    }
    if (closed) this.context.closePath();
    this.finish(style);
  }

  text(x: number, y: number, text: string, style: TextStyle): void {
    const { context } = this;
    context.font = `${style.bold ? "600 " : ""}${style.size}px ${FONT}`;
    context.textAlign = style.anchor === "middle" ? "center" : (style.anchor ?? "start");
    context.textBaseline = "alphabetic";
    context.fillStyle = style.fill;
    context.fillText(text, x, y);
  }

  rectangle(x: number, y: number, width: number, height: number, style: Style): void {
    this.context.beginPath();
    this.context.rect(x, y, width, height);
    this.finish(style);
  }

  clipped(x: number, y: number, width: number, height: number, draw: () => void): void {
    this.context.save();
    this.context.beginPath();
    this.context.rect(x, y, width, height);
    this.context.clip();
    draw();
    this.context.restore();
  }

  private finish(style: Style): void {
    const { context } = this;
    context.globalAlpha = style.opacity ?? 1;
    if (style.fill !== undefined) {
      context.fillStyle = style.fill;
      context.fill();
    }
    if (style.stroke !== undefined) {
      context.strokeStyle = style.stroke;
      context.lineWidth = style.width ?? 1;
      context.setLineDash([...(style.dash ?? [])]);
      context.stroke();
    }
    context.globalAlpha = 1;
  }
}

export class SvgPainter implements Painter {
  private readonly parts: string[] = [];
  private clips = 0;

  circle(x: number, y: number, radius: number, style: Style): void {
    this.parts.push(`<circle cx="${short(x)}" cy="${short(y)}" r="${short(radius)}"${attributes(style)}/>`);
  }

  line(points: ArrayLike<number>, style: Style, closed = false): void {
    const listed = Array.from(points, short).join(" ");
    this.parts.push(`<${closed ? "polygon" : "polyline"} points="${listed}"${attributes(style)}/>`);
  }

  text(x: number, y: number, text: string, style: TextStyle): void {
    const weight = style.bold ? ' font-weight="600"' : "";
    const place = `x="${short(x)}" y="${short(y)}" font-size="${style.size}" text-anchor="${style.anchor ?? "start"}"`;
    this.parts.push(`<text ${place}${weight} fill="${escaped(style.fill)}">${escaped(text)}</text>`);
  }

  rectangle(x: number, y: number, width: number, height: number, style: Style): void {
    const size = `width="${short(width)}" height="${short(height)}"`;
    this.parts.push(`<rect x="${short(x)}" y="${short(y)}" ${size}${attributes(style)}/>`);
  }

  clipped(x: number, y: number, width: number, height: number, draw: () => void): void {
    const id = `clip${this.clips++}`;
    this.parts.push(
      `<clipPath id="${id}"><rect x="${short(x)}" y="${short(y)}" width="${short(width)}" height="${short(height)}"/>` +
        `</clipPath><g clip-path="url(#${id})">`,
    );
    draw();
    this.parts.push("</g>");
  }

  /** Puts another drawing into this one. */
  embed(x: number, y: number, svg: string): void {
    this.parts.push(svg.replace("<svg ", `<svg x="${short(x)}" y="${short(y)}" `));
  }

  /** The whole drawing. `title` is its name for those who cannot see it. */
  document(width: number, height: number, title: string): string {
    const size = `width="${width}" height="${height}" viewBox="0 0 ${width} ${height}"`;
    return (
      `<svg xmlns="http://www.w3.org/2000/svg" ${size} font-family="${FONT}"><title>${escaped(title)}</title>` +
      `${this.parts.join("")}</svg>`
    );
  }
}

function attributes(style: Style): string {
  const dash = style.dash ? ` stroke-dasharray="${style.dash.join(" ")}"` : "";
  const stroke = style.stroke === undefined ? "" : ` stroke="${escaped(style.stroke)}" stroke-width="${style.width ?? 1}"${dash}`;
  const opacity = style.opacity === undefined ? "" : ` opacity="${style.opacity}"`;
  return ` fill="${escaped(style.fill ?? "none")}"${stroke}${opacity}`;
}

const short = (value: number) => String(Math.round(value * 100) / 100);

function escaped(text: string): string {
  return text.replace(/[&<>"']/g, (character) => `&#${character.charCodeAt(0)};`);
}
