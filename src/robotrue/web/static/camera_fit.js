// Moves a camera back until points fill the picture, looking along a direction it keeps.
"use strict";

const MARGIN = 0.06; // of the picture, on every side
const BELOW = 0.1; // of the picture, for the legend

// Points are [x, y, z, x, ...]; towards is the unit vector from them to the camera; least is the
// smallest extent in m that is shown. Returns the point looked at; the camera stands right.
export function fitCamera(T, camera, points, towards, least) {
  const right = new T.Vector3().crossVectors(camera.up, towards).normalize();
  const up = new T.Vector3().crossVectors(towards, right);
  const middle = new T.Box3().setFromArray(points).getCenter(new T.Vector3());
  const v = new T.Vector3();
  const half = Math.tan((camera.fov * Math.PI) / 360), wide = half * camera.aspect * (1 - 2 * MARGIN), high = half * (1 - 2 * MARGIN - BELOW);
  const axes = [[right, wide], [up, high]];
  let away = least / (2 * Math.min(wide, high));
  const shift = axes.map(([axis, t]) => {
    let one = -Infinity, other = -Infinity;
    for (let i = 0; i < points.length; i += 3) {
      v.fromArray(points, i).sub(middle);
      const side = v.dot(axis), near = v.dot(towards) * t;
      one = Math.max(one, side + near);
      other = Math.max(other, near - side);
    }
    away = Math.max(away, (one + other) / (2 * t));
    return (one - other) / 2;
  });
  middle.addScaledVector(right, shift[0]).addScaledVector(up, shift[1] - BELOW * half * away);
  camera.position.copy(middle).addScaledVector(towards, away);
  camera.near = Math.max(0.01, away / 200);
  camera.far = Math.max(60, 20 * away);
  camera.updateProjectionMatrix();
  return middle;
}
