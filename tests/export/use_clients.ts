// Uses what the npm packages of the clients declare; test_packages.py checks the types.

import type { Scene as BabylonScene } from '@babylonjs/core/scene.js';
import type { AppBase } from 'playcanvas';
import { Color, Mesh, Scene, Vector3, type WebGLRenderer } from 'three';
import * as babylon from 'hemibake-babylon';
import { LightControl, readManifest } from 'hemibake-manifest';
import * as playcanvas from 'hemibake-playcanvas';
import * as three from 'hemibake-three';

async function change(room: LightControl): Promise<string[]> {
  await room.setState('Night', { seconds: 2 });
  room.setGroup('Lamps', [1, 0.8, 0.6], 0.5);
  return [...room.problems, ...room.states, ...room.groups];
}

export async function showThree(renderer: WebGLRenderer, scene: Scene, character: Mesh): Promise<void> {
  const room: three.LightmappedScene = await new three.HemibakeLoader(renderer, { maps: 'beside' }).load('room.glb');
  scene.add(room.scene);
  await change(room);
  room.setGroup('Lamps', new Color(1, 0.8, 0.6));
  const probes = await three.loadProbeGrids('hemibake.json');
  room.add(probes);
  scene.add(...probes.grids);
  probes.apply(character);
  const { reflections, problems } = await three.loadReflections('hemibake.json', renderer, { format: 'ktx2' });
  reflections.apply(scene);
  const levels: number | undefined = reflections.cubeAt(new Vector3())?.levels;
  console.log(levels, problems, room.gltf.cameras);
  for (const part of [room, probes, reflections]) part.dispose();
}

export async function showBabylon(scene: BabylonScene): Promise<string[]> {
  const room = await new babylon.HemibakeLoader(scene).load('room.glb');
  console.log(room.meshes.map(mesh => mesh.name), room.loaded.animationGroups);
  return change(room);
}

export async function showPlayCanvas(app: AppBase): Promise<string[]> {
  const room = await new playcanvas.HemibakeLoader(app).load('room.glb');
  app.root.addChild(room.entity);
  console.log(room.asset.name);
  return change(room);
}

export function statesOf(json: unknown): string[] {
  return Object.keys(readManifest(json, 'hemibake.json').manifest.states);
}
