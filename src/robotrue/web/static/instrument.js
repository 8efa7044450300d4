// The measuring instrument of a cell in its 3-D view: a head on a tripod, a beam to the point chosen.
"use strict";

const HEAD = 0.1; // m, radius
const STAND = 1.2; // m, height of the tripod where the floor is not near
const SPREAD = 0.32; // of that height, from its middle to a foot
const BEAM = 0xd8432b;

export function drawInstruments(T, group, places, dark) {
  const paint = new T.MeshLambertMaterial({ color: dark ? 0x9aa7b4 : 0x3d4852 });
  for (const [x, y, z] of places) {
    const device = new T.Group();
    const tall = z > 0.4 && z < 2.5 ? z : STAND;
    const body = new T.Mesh(new T.CylinderGeometry(0.6 * HEAD, 0.85 * HEAD, 2 * HEAD, 20), paint);
    body.rotation.x = Math.PI / 2;
    body.position.z = -1.6 * HEAD;
    device.add(new T.Mesh(new T.SphereGeometry(HEAD, 20, 14), paint), body);
    for (let k = 0; k < 3; k++) {
      const turn = (2 * Math.PI * k) / 3 + 0.5;
      const foot = new T.Vector3(SPREAD * tall * Math.cos(turn), SPREAD * tall * Math.sin(turn), -tall);
      const top = new T.Vector3(0, 0, -2.4 * HEAD);
      const leg = new T.Mesh(new T.CylinderGeometry(0.014, 0.018, foot.distanceTo(top), 8), paint);
      leg.position.copy(foot).add(top).multiplyScalar(0.5);
      leg.quaternion.setFromUnitVectors(new T.Vector3(0, 1, 0), top.clone().sub(foot).normalize());
      device.add(leg);
    }
    device.position.set(x, y, z);
    group.add(device);
  }
}

// A thin line from the instrument that is nearest to a point.
export function drawBeam(T, group, places, point) {
  const to = new T.Vector3(...point);
  const from = places.map((at) => new T.Vector3(...at)).sort((a, b) => a.distanceTo(to) - b.distanceTo(to))[0];
  if (!from) return;
  group.add(new T.Line(new T.BufferGeometry().setFromPoints([from, to]), new T.LineBasicMaterial({ color: BEAM })));
}
