// How a point of a tile becomes pixels: one shader for all tiles, so that another colour needs no new tiles.

import {
  ClampToEdgeWrapping,
  Color,
  DataTexture,
  GLSL3,
  LinearFilter,
  ShaderMaterial,
  SRGBColorSpace,
  Vector2,
  type BufferGeometry,
  type IUniform,
} from 'three';
import { changeColours, rampBytes, ramps, type ColourMode } from './ramps';

const vertexShader = /* glsl */ `
  in float _stability;
  in float _age;
  in float _ground;
  in float _intensity;
  in float _class;

  uniform int mode;
  uniform vec2 heightRange;
  uniform float ageRange;
  uniform float fade;
  uniform float finest;          // metres between the points of the finest level
  uniform float coarse;          // pixels between points where finer levels are not shown
  uniform float pixelsPerMetre;  // at a distance of one metre
  uniform float largest;
  uniform vec4 has;              // stability, age, ground, intensity
  uniform float hasNormal;
  uniform sampler2D ramp;
  uniform vec3 classColours[3];
  uniform vec3 classShown;
  uniform vec3 haze;

  out vec3 shade;

  float place(vec4 world) {
    if (mode == 1) return has.x > 0.0 ? _stability : 0.5;
    if (mode == 2) return has.z > 0.0 ? step(0.5, _ground) : 0.0;
    if (mode == 3) return has.y > 0.0 ? _age / ageRange : 0.0;
    if (mode == 4) return has.w > 0.0 ? sqrt(_intensity) : 0.5;
    return (world.z - heightRange.x) / max(heightRange.y - heightRange.x, 0.01);
  }

  void main() {
    vec4 world = modelMatrix * vec4(position, 1.0);
    vec4 eye = viewMatrix * world;
    gl_Position = projectionMatrix * eye;
    gl_PointSize = clamp(1.35 * max(finest * pixelsPerMetre / max(-eye.z, 0.01), coarse), 1.5, largest);

    vec3 colour;
    if (mode == 5) {
      int kind = int(_class + 0.5);
      colour = classColours[kind];
      if (classShown[kind] < 0.5) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    } else {
      colour = texture(ramp, vec2(clamp(place(world), 0.0, 1.0), 0.5)).rgb;
    }
    // The inverse transpose: tiles are quantised with a scale of their own an axis.
    mat3 m = mat3(modelMatrix);
    vec3 n = m[0] * normal.x / dot(m[0], m[0]) + m[1] * normal.y / dot(m[1], m[1]) + m[2] * normal.z / dot(m[2], m[2]);
    float size = length(n);
    if (hasNormal > 0.0 && size > 0.0) {
      // Light from above and from over the viewer's shoulder, enough to tell faces apart.
      n /= size;
      vec3 towards = normalize(cameraPosition - world.xyz);
      float sky = 0.5 + 0.5 * n.z;
      float front = abs(dot(n, towards));
      float side = 0.5 + 0.5 * dot(n, normalize(vec3(-0.5, -0.8, 0.3)));
      colour *= 0.5 + 0.22 * sky + 0.2 * front + 0.24 * side;
    }
    shade = mix(colour, haze, fade);
  }
`;

const fragmentShader = /* glsl */ `
  in vec3 shade;
  out vec4 colour;
  void main() {
    vec2 p = gl_PointCoord - 0.5;
    if (dot(p, p) > 0.25) discard;
    colour = linearToOutputTexel(vec4(shade, 1.0));
  }
`;

const codes: Record<ColourMode | 'class', number> = {
  height: 0,
  stability: 1,
  ground: 2,
  age: 3,
  intensity: 4,
  class: 5,
};

function rampTexture(mode: ColourMode): DataTexture {
  const texture = new DataTexture(rampBytes(ramps[mode], 256), 256, 1);
  texture.colorSpace = SRGBColorSpace;
  texture.minFilter = texture.magFilter = LinearFilter;
  texture.wrapS = texture.wrapT = ClampToEdgeWrapping;
  texture.needsUpdate = true;
  return texture;
}

type Uniforms = Record<string, IUniform>;

/** The colours that all tiles of a layer share; a tile's own material refers to them. */
export class PointMaterial {
  private readonly textures: Record<ColourMode, DataTexture>;
  private readonly shared: Uniforms;

  constructor() {
    this.textures = {
      height: rampTexture('height'),
      stability: rampTexture('stability'),
      ground: rampTexture('ground'),
      age: rampTexture('age'),
      intensity: rampTexture('intensity'),
    };
    this.shared = {
      mode: { value: 0 },
      heightRange: { value: new Vector2(0, 10) },
      ageRange: { value: 1 },
      fade: { value: 0 },
      finest: { value: 0.05 },
      coarse: { value: 1 },
      pixelsPerMetre: { value: 500 },
      largest: { value: 14 },
      ramp: { value: this.textures.height },
      classColours: {
        value: [changeColours.appeared, changeColours.disappeared, changeColours.unstable].map((c) => new Color(c)),
      },
      classShown: { value: [1, 1, 1] },
      haze: { value: new Color('#1b2430') },
    };
  }

  /** For one tile. Belongs to whoever asks. */
  forTile(geometry: BufferGeometry): ShaderMaterial {
    const has = (name: string) => (geometry.hasAttribute(name) ? 1 : 0);
    return new ShaderMaterial({
      glslVersion: GLSL3,
      vertexShader,
      fragmentShader,
      uniforms: {
        ...this.shared,
        has: { value: [has('_stability'), has('_age'), has('_ground'), has('_intensity')] },
        hasNormal: { value: has('normal') },
      },
    });
  }

  private set(name: string, value: unknown): void {
    const uniform = this.shared[name];
    if (uniform) uniform.value = value;
  }

  setMode(mode: ColourMode | 'class'): void {
    this.set('mode', codes[mode]);
    if (mode !== 'class') this.set('ramp', this.textures[mode]);
  }

  setHeightRange(low: number, high: number): void {
    this.set('heightRange', new Vector2(low, high));
  }

  setAgeRange(days: number): void {
    this.set('ageRange', Math.max(days, 1e-3));
  }

  /** 0: as it is, 1: background. */
  setFade(fade: number): void {
    this.set('fade', fade);
  }

  /** Of the points: metres where all are shown, pixels where finer levels are left out. */
  setSpacing(metres: number, pixels: number): void {
    this.set('finest', metres);
    this.set('coarse', pixels);
  }

  setPixelsPerMetre(pixels: number, ratio: number): void {
    this.set('pixelsPerMetre', pixels);
    this.set('largest', 14 * ratio);
  }

  setClassesShown(shown: [boolean, boolean, boolean]): void {
    this.set('classShown', shown.map(Number));
  }

  dispose(): void {
    for (const texture of Object.values(this.textures)) texture.dispose();
  }
}
