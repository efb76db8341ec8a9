// Present mix of light groups: light = sum of factor x map.

const WHITE = [1, 1, 1];

/** Linear RGB factor of each light group, changed by states and by single groups. */
export class LightMix {
  #fade = null; #state = null; #others;

  /**
   * names:   names of the light groups
   * states:  factors by state and group; groups that a state leaves out have the factor 1, 1, 1
   * others:  names of light groups of other files, which states may name too
   */
  constructor(names, states = {}, others = []) {
    this.states = states;
    this.#others = new Set(others);
    this.factors = new Map([...names].map(name => [name, WHITE]));
  }

  /** Messages on groups that states name and no file has; the other groups are shown. */
  get problems() {
    return Object.entries(this.states).flatMap(([state, groups]) => Object.keys(groups)
      .filter(group => !this.factors.has(group) && !this.#others.has(group))
      .map(group => `State '${state}': no light group '${group}'. Rename it in Blender, or bake it and export again.`));
  }

  /** Adds light groups, with the factors of the present state. */
  addGroups(names) {
    for (const name of names) {
      if (!this.factors.has(name)) this.factors.set(name, this.states[this.#state]?.[name] ?? WHITE);
    }
  }

  /** Sets color, [r, g, b] or { r, g, b }, linear, and strength of a group; throws an Error that names it. */
  setGroup(name, color, strength = 1) {
    if (!this.factors.has(name)) throw new Error(unknown('Light group', name, [...this.factors.keys()]));
    this.#fade = this.#state = null;
    this.factors.set(name, rgb(color).map(value => value * strength));
  }

  /**
   * Changes to a state within seconds, counted from `now`; throws an Error that names it.
   *
   * Without seconds the state is set at once; else `advance` has to be called.
   */
  setState(name, seconds = 0, now = 0) {
    if (!Object.hasOwn(this.states, name)) throw new Error(unknown('Light state', name, Object.keys(this.states)));
    this.#state = name;
    const after = new Map([...this.factors.keys()].map(group => [group, this.states[name][group] ?? WHITE]));
    this.#fade = { before: new Map(this.factors), after, start: now, seconds };
    this.advance(seconds > 0 ? now : now + 1);
  }

  /** Sets the factors of a fade at a time, s; returns true while it lasts. */
  advance(now) {
    if (this.#fade === null) return false;
    const { before, after, start, seconds } = this.#fade;
    const part = seconds > 0 ? Math.min(1, Math.max(0, (now - start) / seconds)) : 1;
    for (const [group, factor] of after) {
      const old = before.get(group);
      this.factors.set(group, factor.map((value, i) => (1 - part) * old[i] + part * value));
    }
    if (part === 1) this.#fade = null;
    return this.#fade !== null;
  }
}

function rgb(color) {
  return Array.isArray(color) ? color : [color.r, color.g, color.b];
}

function unknown(kind, name, known) {
  return `${kind} '${name}': not in the file. Choose one of: ${known.map(other => `'${other}'`).join(', ') || 'none'}.`;
}
