// The obstacles of a cell in its 3-D view: boxes, spheres, and the plane of a floor or a wall.
const COLOUR = 0x8895a3;
const OPACITY = 0.28;
const PLANE_OPACITY = 0.1; // the grid of the floor shows through
const PLANE_WIDTH = 6; // m, of a floor or a wall that has no end

export function drawObstacles(three, group, list) {
  const T = three.THREE;
  for (const body of list) {
    const shape = body.low ? box(T, body) : body.centre ? sphere(T, body) : plane(T, body);
    shape.name = body.name;
    group.add(shape);
  }
}

function surface(T, geometry, opacity = OPACITY) {
  const paint = new T.MeshBasicMaterial({ color: COLOUR, transparent: true, opacity, side: T.DoubleSide, depthWrite: false });
  const mesh = new T.Mesh(geometry, paint);
  mesh.add(new T.LineSegments(new T.EdgesGeometry(geometry, 30), new T.LineBasicMaterial({ color: COLOUR })));
  return mesh;
}

function box(T, { low, high }) {
  const mesh = surface(T, new T.BoxGeometry(...high.map((v, k) => v - low[k])));
  mesh.position.set(...high.map((v, k) => (v + low[k]) / 2));
  return mesh;
}

function sphere(T, { centre, radius }) {
  const mesh = surface(T, new T.SphereGeometry(radius, 32, 16));
  mesh.position.set(...centre);
  return mesh;
}

function plane(T, { point, normal }) {
  const mesh = surface(T, new T.PlaneGeometry(PLANE_WIDTH, PLANE_WIDTH), PLANE_OPACITY);
  mesh.quaternion.setFromUnitVectors(new T.Vector3(0, 0, 1), new T.Vector3(...normal));
  mesh.position.set(...point);
  return mesh;
}
