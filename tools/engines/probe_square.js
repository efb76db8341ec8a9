// A small white square before a camera: its pixel is the light at a point for a normal.

/** Return the scene and the camera, and `show`, which places both. THREE: three or three/webgpu. */
export function probeSquare(THREE) {
  const scene = new THREE.Scene();
  const square = new THREE.Mesh(new THREE.PlaneGeometry(0.01, 0.01), new THREE.MeshLambertMaterial());
  const camera = new THREE.OrthographicCamera(-0.001, 0.001, 0.001, -0.001, 0, 1);
  scene.add(square);
  const show = ({ position, normal }) => {
    const at = new THREE.Vector3(...position), along = new THREE.Vector3(...normal);
    square.position.copy(at);
    square.lookAt(at.clone().add(along));
    camera.position.copy(at).addScaledVector(along, 0.5);
    camera.lookAt(at);
  };
  return { scene, square, camera, show };
}
