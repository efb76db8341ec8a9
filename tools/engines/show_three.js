// Renders an exported file through its camera, once or with an object at places of a path that light probes light.

import * as THREE from 'three';
import { HemibakeLoader, loadProbeGrids } from 'hemibake-three';

export async function render(asked) {
  const { file, files, width, height, hide, groups, state, seconds, background, moved, places } = asked;
  const renderer = new THREE.WebGLRenderer({ antialias: false });
  const loader = new HemibakeLoader(renderer, { maps: files ? 'beside' : 'inside' });
  const room = await loader.load(`/file/${encodeURIComponent(file)}`), problems = room.problems;
  const named = name => object => (object.userData.name ?? object.name) === name;
  const objects = [];
  room.scene.traverse(object => objects.push(object));
  for (const name of hide) for (const object of objects.filter(named(name))) object.visible = false;
  const mover = objects.find(named(moved));
  if (mover) {
    const probes = await loadProbeGrids(`/file/${asked.probes}`);
    room.add(probes);
    problems.push(...probes.problems);
    probes.apply(mover);
    room.scene.add(...probes.grids);
  }
  for (const [name, color, strength] of groups) room.setGroup(name, color, strength);
  if (state) await room.setState(state, { seconds });

  const target = new THREE.WebGLRenderTarget(width, height, { type: THREE.FloatType });
  const camera = room.gltf.cameras[0];
  camera.aspect = width / height;
  camera.updateProjectionMatrix();
  renderer.setRenderTarget(target);
  renderer.setClearColor(new THREE.Color(...background), 1);
  const count = 4 * width * height, pixels = new Float32Array(count * places.length);
  for (const [i, place] of places.entries()) {
    if (mover) mover.position.set(...place);
    renderer.render(room.scene, camera);
    renderer.readRenderTargetPixels(target, 0, 0, width, height, pixels.subarray(i * count, (i + 1) * count));
  }
  return { pixels, problems };
}
