/** Draws points and outlines with WebGL2: a million points in one call. */

import type { Size, View } from "../draw/view";

const POINT_SHADER = `#version 300 es
in vec2 place; in uint colour; uniform vec4 view; uniform float size; uniform vec3 palette[9]; out vec3 shade;
void main() {
  gl_Position = colour > 8u ? vec4(2.0, 2.0, 2.0, 1.0) : vec4((place - view.xy) * view.zw, 0.0, 1.0);
  gl_PointSize = size;
  shade = palette[min(colour, 8u)];
}`;
const POINT_PAINT = `#version 300 es
precision highp float; in vec3 shade; uniform float size; uniform float alpha; out vec4 paint;
void main() {
  float away = length(gl_PointCoord - 0.5) * size;
  float edge = size > 3.0 ? clamp(size * 0.5 - away, 0.0, 1.0) : 1.0;
  paint = vec4(shade, 1.0) * alpha * edge;
}`;
const LINE_PAINT = `#version 300 es
precision highp float; in vec3 shade; uniform float alpha; out vec4 paint;
void main() { paint = vec4(shade, 1.0) * alpha; }`;

/** The number of a colour that is not drawn. */
export const HIDDEN = 255;

/** Points or lines: x, y and the number of a colour for each vertex. */
export interface Vertices {
  readonly xy: Float32Array;
  readonly colour: Uint8Array;
}

export class Layer {
  private readonly points: Batch;
  private readonly lines: Batch;

  private constructor(private readonly gl: WebGL2RenderingContext) {
    this.points = new Batch(gl, POINT_SHADER, POINT_PAINT);
    this.lines = new Batch(gl, POINT_SHADER, LINE_PAINT);
  }

  /** A layer on a canvas; null if the browser has no WebGL2. */
  static on(canvas: HTMLCanvasElement): Layer | null {
    const gl = canvas.getContext("webgl2", { antialias: false, premultipliedAlpha: true, preserveDrawingBuffer: true });
    return gl && new Layer(gl);
  }

  setPoints(vertices: Vertices): void {
    this.points.fill(vertices);
  }

  /** Other colours for the same points and lines. */
  recolour(points: Uint8Array, lines: Uint8Array): void {
    this.points.recolour(points);
    this.lines.recolour(lines);
  }

  /** Pairs of vertices, each of which is a line. */
  setLines(vertices: Vertices): void {
    this.lines.fill(vertices);
  }

  /** Draws everything. `palette`: 9 colours of 3 numbers from 0 to 1; `ink`: how opaque outlines are; 0: not drawn. */
  draw(view: View, size: Size, ratio: number, palette: Float32Array, ink: number): void {
    const { gl } = this;
    gl.viewport(0, 0, Math.round(size.width * ratio), Math.round(size.height * ratio));
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    const window = [view.x, view.y, (2 * view.scale) / size.width, (2 * view.scale) / size.height] as const;
    if (ink > 0) this.lines.draw(gl.LINES, window, 1, ink, palette);
    const pixels = Math.min(Math.max(0.9 * view.scale, 1.9), 10) * ratio;
    this.points.draw(gl.POINTS, window, pixels, view.scale > 1 ? 0.95 : 0.8, palette);
  }

  dispose(): void {
    this.gl.getExtension("WEBGL_lose_context")?.loseContext();
  }
}

class Batch {
  private readonly program: WebGLProgram;
  private readonly array: WebGLVertexArrayObject;
  private readonly buffers: readonly [WebGLBuffer, WebGLBuffer];
  private count = 0;

  constructor(
    private readonly gl: WebGL2RenderingContext,
    vertex: string,
    fragment: string,
  ) {
    this.program = programOf(gl, vertex, fragment);
    this.array = gl.createVertexArray();
    this.buffers = [gl.createBuffer(), gl.createBuffer()];
    gl.bindVertexArray(this.array);
    const place = gl.getAttribLocation(this.program, "place");
    const colour = gl.getAttribLocation(this.program, "colour");
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[0]);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, 2, gl.FLOAT, false, 0, 0);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[1]);
    gl.enableVertexAttribArray(colour);
    gl.vertexAttribIPointer(colour, 1, gl.UNSIGNED_BYTE, 0, 0);
    gl.bindVertexArray(null);
  }

  fill({ xy, colour }: Vertices): void {
    const { gl } = this;
    this.count = xy.length / 2;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[0]);
    gl.bufferData(gl.ARRAY_BUFFER, xy, gl.STATIC_DRAW);
    this.recolour(colour);
  }

  recolour(colour: Uint8Array) {
    const { gl } = this;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[1]);
    gl.bufferData(gl.ARRAY_BUFFER, colour, gl.STATIC_DRAW);
  }

  draw(mode: number, view: readonly [number, number, number, number], size: number, alpha: number, palette: Float32Array) {
    if (this.count === 0) return;
    const { gl, program } = this;
    gl.useProgram(program);
    gl.uniform4f(gl.getUniformLocation(program, "view"), ...view);
    gl.uniform1f(gl.getUniformLocation(program, "size"), size);
    gl.uniform1f(gl.getUniformLocation(program, "alpha"), alpha);
    gl.uniform3fv(gl.getUniformLocation(program, "palette"), palette);
    gl.bindVertexArray(this.array);
    gl.drawArrays(mode, 0, this.count);
    gl.bindVertexArray(null);
  }
}

function programOf(gl: WebGL2RenderingContext, vertex: string, fragment: string): WebGLProgram {
  const program = gl.createProgram();
  for (const [kind, source] of [
    [gl.VERTEX_SHADER, vertex],
    [gl.FRAGMENT_SHADER, fragment],
  ] as const) {
    const shader = gl.createShader(kind)!;
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) {
    throw new Error(`The map cannot be drawn: ${gl.getProgramInfoLog(program)}`);
  }
  return program;
}
