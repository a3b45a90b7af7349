// Colours by value: the one place that the picture and the legend take them from. Ramps grow in lightness, so that they
// read the same to eyes that confuse hues.

export type ColourMode = 'height' | 'stability' | 'ground' | 'age' | 'intensity';

export const colourModes: ColourMode[] = ['height', 'stability', 'ground', 'age', 'intensity'];

/** sRGB, evenly spaced from the lowest value to the highest. */
export const ramps: Record<ColourMode | 'fitness', string[]> = {
  height: ['#26326e', '#2a5f9e', '#2793a6', '#45bd8f', '#9bd96b', '#f0ea8a', '#fff8dc'],
  stability: ['#7a2048', '#c4403f', '#ee8a3c', '#f2cf63', '#a5dba0', '#7fe3d4'],
  ground: ['#e0a15e', '#4b8fd6'],
  age: ['#ffe08a', '#f2a65a', '#d1607a', '#8a4fa3', '#4a4a9c'],
  intensity: ['#20242c', '#56616f', '#98a4b3', '#f4f7fa'],
  fitness: ['#e0455e', '#f08a4b', '#f4cf5e', '#8fd98a', '#3fc7a0'],
};

export const changeColours = { appeared: '#3ddc97', disappeared: '#ff5d73', unstable: '#f7b955' };

export type Rgb = [number, number, number];

export function rgbOf(hex: string): Rgb {
  const bits = Number.parseInt(hex.slice(1), 16);
  return [(bits >> 16) / 255, ((bits >> 8) & 255) / 255, (bits & 255) / 255];
}

/** The colour at `t` in [0, 1]; values outside get the end's. */
export function colourAt(ramp: string[], t: number): Rgb {
  const last = ramp.length - 1;
  const u = Math.min(Math.max(t, 0), 1) * last;
  const i = Math.min(Math.floor(u), last - 1);
  const a = rgbOf(ramp[i] ?? '#000000');
  const b = rgbOf(ramp[i + 1] ?? '#000000');
  const f = u - i;
  return [a[0] + f * (b[0] - a[0]), a[1] + f * (b[1] - a[1]), a[2] + f * (b[2] - a[2])];
}

/** RGBA bytes of `size` steps along a ramp. */
export function rampBytes(ramp: string[], size: number): Uint8Array {
  const out = new Uint8Array(4 * size);
  for (let i = 0; i < size; ++i) {
    const [r, g, b] = colourAt(ramp, i / (size - 1));
    out.set([Math.round(255 * r), Math.round(255 * g), Math.round(255 * b), 255], 4 * i);
  }
  return out;
}
