// Measures the light of probe grids on white surfaces with WebGPURenderer, and sends back linear pixels.

import * as THREE from 'three/webgpu';
import { LightProbeGrid } from 'three/addons/lighting/LightProbeGrid.js';
import { loadProbeGrids } from 'hemibake-three';

export async function render({ surfaces, intensity = 1 }) {
  const { grids, problems } = await loadProbeGrids('/file/hemibake.json', { Grid: LightProbeGrid });
  for (const grid of grids) grid.intensity = intensity;
  const renderer = new THREE.WebGPURenderer(), scene = new THREE.Scene();
  await renderer.init();
  if (!renderer.backend.isWebGPUBackend) throw new Error('Chromium has no WebGPU.');
  const square = new THREE.Mesh(new THREE.PlaneGeometry(0.01, 0.01), new THREE.MeshLambertMaterial());
  const camera = new THREE.OrthographicCamera(-0.001, 0.001, 0.001, -0.001, 0, 1);
  const target = new THREE.RenderTarget(1, 1, { type: THREE.FloatType });
  const pixels = new Float32Array(4 * surfaces.length);
  scene.add(square, ...grids);
  renderer.setRenderTarget(target);
  for (const [i, { position, normal }] of surfaces.entries()) {
    const at = new THREE.Vector3(...position), away = at.clone().add(new THREE.Vector3(...normal));
    square.position.copy(at);
    square.lookAt(away);
    camera.position.copy(at).addScaledVector(new THREE.Vector3(...normal), 0.5);
    camera.lookAt(at);
    renderer.render(scene, camera);
    pixels.set((await renderer.readRenderTargetPixelsAsync(target, 0, 0, 1, 1)).subarray(0, 4), 4 * i);
  }
  return { pixels, problems };
}
