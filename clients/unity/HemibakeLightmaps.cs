// Not run: see README.md. Shows the lightmaps of a model that Hemibake has exported.
using System;
using System.Collections.Generic;
using System.Linq;
using UnityEngine;

/// <summary>Adds lightmaps to the scene when it loads, and assigns them to renderers.</summary>
[ExecuteAlways]
public sealed class HemibakeLightmaps : MonoBehaviour
{
    /// <summary>A renderer and the index of its map in <see cref="maps"/>.</summary>
    [Serializable]
    public struct Shown
    {
        public Renderer renderer;
        public int map;
    }

    /// <summary>Lightmaps: E / pi, linear.</summary>
    public Texture2D[] maps = Array.Empty<Texture2D>();

    public Shown[] shown = Array.Empty<Shown>();

    /// <summary>All components that are enabled: together they make up the lightmaps of the scene.</summary>
    static readonly List<HemibakeLightmaps> Enabled = new();

    void OnEnable()
    {
        Enabled.Add(this);
        Apply();
    }

    void OnDisable()
    {
        Enabled.Remove(this);
        foreach (var entry in shown.Where(entry => entry.renderer != null))
            entry.renderer.lightmapIndex = -1;
        Apply();
    }

    /// <summary>Sets the lightmaps of the scene and of all renderers.</summary>
    public static void Apply()
    {
        var all = new List<LightmapData>();
        foreach (var component in Enabled)
        {
            int first = all.Count;
            all.AddRange(component.maps.Select(map => new LightmapData { lightmapColor = map }));
            foreach (var entry in component.shown.Where(entry => entry.renderer != null))
            {
                entry.renderer.lightmapIndex = first + entry.map;
                entry.renderer.lightmapScaleOffset = new Vector4(1, 1, 0, 0); // The UVs are final.
            }
        }
        LightmapSettings.lightmapsMode = LightmapsMode.NonDirectional;
        LightmapSettings.lightmaps = all.ToArray();
    }
}
