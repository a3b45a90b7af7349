// How many points a frame may draw: while the view moves only as many as the machine draws in time, at rest the budget.

const wanted = 60; // ms a frame while the view moves
const fewest = 60_000;

/** Whether the browser draws with the processor, for want of a graphics card. */
export function isSoftwareRenderer(gl: WebGLRenderingContext | WebGL2RenderingContext): boolean {
  const info = gl.getExtension('WEBGL_debug_renderer_info');
  const name = String(info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : gl.getParameter(gl.RENDERER));
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}

/** Where the budget begins, by what the device seems to be. */
export function defaultBudget(software: boolean): number {
  if (software) return 400_000;
  const small = Math.min(window.screen.width, window.screen.height) < 600;
  const memory = (navigator as { deviceMemory?: number }).deviceMemory ?? 8;
  return small || memory < 4 ? 800_000 : 3_000_000;
}

export class FrameBudget {
  private millisecondsAPoint = 0;
  private lastBegin = 0;
  private lastDrawn = 0;
  private wasMoving = false;

  /** The most points that the frame which begins now may draw. */
  begin(time: number, moving: boolean, budget: number): number {
    // From frame to frame, as drawing goes on after the calls have returned. Only frames that follow each other count.
    const since = time - this.lastBegin;
    if (moving && this.wasMoving && this.lastDrawn > fewest / 2 && since < 2000) {
      const sample = since / this.lastDrawn;
      this.millisecondsAPoint = this.millisecondsAPoint ? 0.7 * this.millisecondsAPoint + 0.3 * sample : sample;
    }
    this.lastBegin = time;
    this.wasMoving = moving;
    const affordable = this.millisecondsAPoint ? wanted / this.millisecondsAPoint : budget;
    return moving ? Math.min(budget, Math.max(fewest, Math.round(affordable))) : budget;
  }

  end(drawn: number): void {
    this.lastDrawn = drawn;
  }

  rest(): void {
    this.wasMoving = false;
  }
}
