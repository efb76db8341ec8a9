// Not run: see README.md. Fills HemibakeLightmaps from hemibake.json.
using System;
using System.Collections.Generic;
using System.IO;
using System.Linq;
using System.Text.RegularExpressions;
using UnityEditor;
using UnityEngine;

static class HemibakeMenu
{
    // JsonUtility reads no dictionaries, so file names are found as the keys of lightmaps of output "combined".
    static readonly Regex Map = new("\"(?<file>[^\"]+\\.exr)\": \\{(?<entry>.*?)\"sha256\"", RegexOptions.Singleline);
    static readonly Regex Shown = new("\"object\": \"(?<name>(?:[^\"\\\\]|\\\\.)*)\"");

    [MenuItem("Tools/Hemibake/Assign Lightmaps")]
    static void Assign()
    {
        var root = Selection.activeGameObject;
        string path = EditorUtility.OpenFilePanel("Manifest of the export", Application.dataPath, "json");
        if (path.Length == 0)
            return;
        var renderers = root.GetComponentsInChildren<Renderer>(true).ToLookup(renderer => Owner(renderer, root));
        var maps = new List<Texture2D>();
        var found = new List<HemibakeLightmaps.Shown>();
        foreach (Match match in Map.Matches(File.ReadAllText(path)))
        {
            string entry = match.Groups["entry"].Value;
            if (!entry.Contains("\"output\": \"combined\"") || !entry.Contains("\"export\""))
                continue;
            string file = Regex.Unescape(match.Groups["file"].Value);
            var texture = AssetDatabase.LoadAssetAtPath<Texture2D>(AssetPath(path, file));
            if (texture == null)
            {
                Debug.LogError($"Hemibake: '{file}' is missing beside the manifest. Copy it and assign again.");
                continue;
            }
            foreach (Match shown in Shown.Matches(entry))
            {
                string name = Regex.Unescape(shown.Groups["name"].Value);
                if (!renderers[name].Any())
                    Debug.LogWarning($"Hemibake: no renderer is named '{name}'. It stays without a lightmap.");
                found.AddRange(renderers[name].Select(renderer => new HemibakeLightmaps.Shown
                {
                    renderer = renderer, map = maps.Count
                }));
            }
            maps.Add(texture);
        }
        var component = root.GetComponent<HemibakeLightmaps>();
        if (component == null)
            component = Undo.AddComponent<HemibakeLightmaps>(root);
        Undo.RecordObject(component, "Assign Lightmaps");
        component.maps = maps.ToArray();
        component.shown = found.ToArray();
        EditorUtility.SetDirty(component);
        HemibakeLightmaps.Apply();
    }

    [MenuItem("Tools/Hemibake/Assign Lightmaps", true)]
    static bool CanAssign() => Selection.activeGameObject != null;

    /// <summary>Importers name parts of an object with several materials otherwise, below its own node.</summary>
    static string Owner(Renderer renderer, GameObject root)
    {
        var parent = renderer.transform.parent;
        bool isPart = renderer.name.StartsWith("Primitive") || renderer.name.EndsWith("_Primitive");
        return isPart && parent != null && parent != root.transform ? parent.name : renderer.name;
    }

    static string AssetPath(string manifest, string file)
    {
        string folder = Path.GetDirectoryName(manifest)!.Replace('\\', '/');
        return $"Assets{folder[Application.dataPath.Length..]}/{file}";
    }
}
