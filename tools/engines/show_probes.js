// Measures the light of probe grids on white surfaces, and sends back linear pixels.

import * as THREE from 'three';
import { loadProbeGrids } from 'hemibake-three';

export async function render({ surfaces, state = '', groups = [], intensity = 1, copies = 0 }) {
  const probes = await loadProbeGrids('/file/hemibake.json'), { grids, problems } = probes;
  if (state) await probes.setState(state);
  for (const [name, color, strength] of groups) probes.setGroup(name, color, strength);
  for (const grid of grids) grid.intensity = intensity;
  const renderer = new THREE.WebGLRenderer(), scene = new THREE.Scene();
  const square = new THREE.Mesh(new THREE.PlaneGeometry(0.01, 0.01), new THREE.MeshLambertMaterial());
  const camera = new THREE.OrthographicCamera(-0.001, 0.001, 0.001, -0.001, 0, 1);
  const target = new THREE.WebGLRenderTarget(1, 1, { type: THREE.FloatType });
  const pixels = new Float32Array(4 * surfaces.length);
  scene.add(square, ...grids);
  for (let i = 0; i < copies; i++) {
    square.material = square.material.clone();
    probes.apply(scene);
  }
  for (const [i, { position, normal }] of surfaces.entries()) {
    const at = new THREE.Vector3(...position), away = at.clone().add(new THREE.Vector3(...normal));
    square.position.copy(at);
    square.lookAt(away);
    camera.position.copy(at).addScaledVector(new THREE.Vector3(...normal), 0.5);
    camera.lookAt(at);
    renderer.setRenderTarget(target);
    renderer.render(scene, camera);
    renderer.readRenderTargetPixels(target, 0, 0, 1, 1, pixels.subarray(4 * i, 4 * i + 4));
  }
  return { pixels, problems };
}
