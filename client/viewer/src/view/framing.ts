// From where a camera sees all of a box.

import { Vector3, type Box3, type PerspectiveCamera } from 'three';

// Of the picture's half width and height; below lies the time line.
const side = 0.97;
const top = 0.92;
const bottom = 0.74;
const rounds = 30;

/**
 * How far the camera must go back from `target` along `direction` (a unit vector) for the whole box to lie in the picture,
 * at most `farthest`. Moves the camera.
 */
export function distanceThatShows(
  camera: PerspectiveCamera,
  target: Vector3,
  direction: Vector3,
  box: Box3,
  farthest: number,
): number {
  const corners = [0, 1, 2, 3, 4, 5, 6, 7].map(
    (i) => new Vector3(i & 1 ? box.max.x : box.min.x, i & 2 ? box.max.y : box.min.y, i & 4 ? box.max.z : box.min.z),
  );
  const shows = (distance: number) => {
    camera.position.copy(target).addScaledVector(direction, distance);
    camera.lookAt(target);
    camera.updateMatrixWorld();
    return corners.every((corner) => {
      const eye = corner.clone().applyMatrix4(camera.matrixWorldInverse);
      if (eye.z > -camera.near) return false;
      const p = eye.applyMatrix4(camera.projectionMatrix);
      return Math.abs(p.x) < side && p.y < top && p.y > -bottom;
    });
  };
  let near = 1;
  let far = farthest;
  for (let i = 0; i < rounds; ++i) {
    const middle = (near + far) / 2;
    if (shows(middle)) far = middle;
    else near = middle;
  }
  return far;
}
