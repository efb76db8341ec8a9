// Measures the light of probe grids on white surfaces with WebGPURenderer, and sends back linear pixels.

import * as THREE from 'three/webgpu';
import { LightProbeGrid } from 'three/addons/lighting/LightProbeGrid.js';
import { loadProbeGrids } from 'hemibake-three';
import { probeSquare } from './probe_square.js';

export async function render({ surfaces, intensity = 1 }) {
  const { grids, problems } = await loadProbeGrids('/file/hemibake.json', { Grid: LightProbeGrid });
  for (const grid of grids) grid.intensity = intensity;
  const renderer = new THREE.WebGPURenderer(), { scene, camera, show } = probeSquare(THREE);
  await renderer.init();
  if (!renderer.backend.isWebGPUBackend) throw new Error('Chromium has no WebGPU.');
  const target = new THREE.RenderTarget(1, 1, { type: THREE.FloatType });
  const pixels = new Float32Array(4 * surfaces.length);
  scene.add(...grids);
  renderer.setRenderTarget(target);
  for (const [i, surface] of surfaces.entries()) {
    show(surface);
    renderer.render(scene, camera);
    pixels.set((await renderer.readRenderTargetPixelsAsync(target, 0, 0, 1, 1)).subarray(0, 4), 4 * i);
  }
  return { pixels, problems };
}
