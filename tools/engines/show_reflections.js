// Measures what mirrors reflect of reflection cubes, and sends back linear pixels.

import * as THREE from 'three';
import { loadReflections } from 'hemibake-three';

export async function render({ mirrors, formats }) {
  const renderer = new THREE.WebGLRenderer(), target = new THREE.WebGLRenderTarget(1, 1, { type: THREE.FloatType });
  const camera = new THREE.PerspectiveCamera(0.01, 1, 0.1, 100), problems = [];
  const pixels = new Float32Array(4 * mirrors.length * formats.length);
  for (const [f, format] of formats.entries()) {
    const loaded = await loadReflections('/file/hemibake.json', renderer, { format });
    problems.push(...loaded.problems);
    for (const [i, { position, normal, eye, roughness }] of mirrors.entries()) {
      const material = new THREE.MeshStandardMaterial({ metalness: 1, roughness });
      const scene = new THREE.Scene(), mirror = new THREE.Mesh(new THREE.PlaneGeometry(0.1, 0.1), material);
      mirror.position.set(...position);
      mirror.lookAt(mirror.position.clone().add(new THREE.Vector3(...normal)));
      scene.add(mirror);
      loaded.reflections.apply(scene);
      camera.position.set(...eye);
      camera.lookAt(mirror.position);
      renderer.setRenderTarget(target);
      renderer.render(scene, camera);
      const at = 4 * (f * mirrors.length + i);
      renderer.readRenderTargetPixels(target, 0, 0, 1, 1, pixels.subarray(at, at + 4));
    }
    loaded.reflections.dispose();
  }
  return { pixels, problems };
}
