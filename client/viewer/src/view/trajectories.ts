// Where robots drove: a line a session, coloured by how well its windows fit the map.

import { Color, Group, Mesh, MeshBasicMaterial, SphereGeometry, SRGBColorSpace, type Vector2 } from 'three';
import { Line2 } from 'three/addons/lines/Line2.js';
import { LineGeometry } from 'three/addons/lines/LineGeometry.js';
import { LineMaterial } from 'three/addons/lines/LineMaterial.js';
import type { FitnessWindow, Vec3 } from '../api/wire';
import { colourAt, ramps, rgbOf, type Rgb } from './ramps';

export const fitnessRange: [number, number] = [0.5, 1];
const unmeasured = rgbOf('#9fb0c6'); // the session that founded the map was fitted to nothing

export interface Trajectory {
  session: string;
  positions: Vec3[];
  windows: FitnessWindow[];
}

/** Of each scan the best fitness of the windows that hold it; -1 where none does. */
export function fitnessOfScans(count: number, windows: FitnessWindow[]): number[] {
  const fitness = new Array<number>(count).fill(-1);
  for (const window of windows) {
    for (let i = window.firstScan; i <= Math.min(window.lastScan, count - 1); ++i) {
      fitness[i] = Math.max(fitness[i] ?? -1, window.fitness);
    }
  }
  return fitness;
}

function colourOf(fitness: number): Rgb {
  if (fitness < 0) return unmeasured;
  return colourAt(ramps.fitness, (fitness - fitnessRange[0]) / (fitnessRange[1] - fitnessRange[0]));
}

export class Trajectories {
  readonly group = new Group();
  private readonly material = new LineMaterial({ linewidth: 3.5, vertexColors: true, worldUnits: false });
  private readonly dot = new SphereGeometry(0.6, 16, 12);

  show(trajectories: Trajectory[]): void {
    this.clear();
    for (const { session, positions, windows } of trajectories) {
      if (positions.length < 2) continue;
      const geometry = new LineGeometry();
      geometry.setPositions(positions.flat());
      const colours = fitnessOfScans(positions.length, windows).flatMap((f) =>
        new Color().setRGB(...colourOf(f), SRGBColorSpace).toArray(),
      );
      geometry.setColors(colours);
      const line = new Line2(geometry, this.material);
      line.name = session;
      this.group.add(line);
      const [x, y, z] = positions[0] as Vec3;
      const start = new Mesh(this.dot, new MeshBasicMaterial({ color: '#ffffff' }));
      start.position.set(x, y, z);
      this.group.add(start);
    }
  }

  resize(size: Vector2): void {
    this.material.resolution.copy(size);
  }

  clear(): void {
    for (const child of this.group.children) {
      if (child instanceof Line2) child.geometry.dispose();
      else if (child instanceof Mesh) (child.material as MeshBasicMaterial).dispose();
    }
    this.group.clear();
  }
}

/** A line between two points that is seen through everything. */
export function rulerLine(): { line: Line2; set(points: Vec3[]): void; resize(size: Vector2): void } {
  const material = new LineMaterial({ color: '#ffd479', linewidth: 2.5, depthTest: false, transparent: true });
  const line = new Line2(new LineGeometry(), material);
  line.renderOrder = 10;
  line.visible = false;
  line.frustumCulled = false;
  return {
    line,
    set(points) {
      line.visible = points.length > 1;
      if (points.length < 2) return;
      line.geometry.dispose();
      line.geometry = new LineGeometry();
      line.geometry.setPositions(points.flat());
    },
    resize: (size) => material.resolution.copy(size),
  };
}

/** Small marks where the user pointed. */
export function pointMarks(): { group: Group; set(points: Vec3[], colour: string): void } {
  const group = new Group();
  const sphere = new SphereGeometry(1, 16, 12);
  return {
    group,
    set(points, colour) {
      for (const child of group.children) ((child as Mesh).material as MeshBasicMaterial).dispose();
      group.clear();
      for (const [x, y, z] of points) {
        const mark = new Mesh(sphere, new MeshBasicMaterial({ color: colour, depthTest: false, transparent: true }));
        mark.renderOrder = 11;
        mark.position.set(x, y, z);
        group.add(mark);
      }
    },
  };
}
