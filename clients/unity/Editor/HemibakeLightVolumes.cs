// Not run: see README.md. Creates the textures of VRC Light Volumes from the light probes of an export.
using System;
using System.IO;
using UnityEditor;
using UnityEngine;

static class HemibakeLightVolumes
{
    [MenuItem("Tools/Hemibake/Create Light Volumes")]
    static void Create()
    {
        string path = EditorUtility.OpenFilePanel("Light probes of the export", Application.dataPath, "json");
        if (path.Length == 0)
            return;
        if (!path.StartsWith(Application.dataPath))
        {
            Debug.LogError($"Hemibake: '{path}' is outside of Assets. Copy it into the project first.");
            return;
        }
        string folder = Path.GetDirectoryName(path)!.Replace('\\', '/');
        folder = $"Assets{folder[Application.dataPath.Length..]}";
        string model = Path.GetFileName(path).Replace(".Probes.json", "");
        foreach (var volume in HemibakeProbes.Read(File.ReadAllText(path)))
        {
            if (volume.textures == null || volume.textures.Length == 0)
            {
                Debug.LogWarning($"Hemibake: '{volume.name}' is sheared, so it has no textures. Apply its scale.");
                continue;
            }
            for (int number = 0; number < volume.textures.Length; number++)
                AssetDatabase.CreateAsset(Texture(volume, number), $"{folder}/{model}.{volume.name}.{number}.asset");
            var box = new GameObject(volume.name);
            Undo.RegisterCreatedObjectUndo(box, "Create Light Volumes");
            float[] p = volume.position, q = volume.rotation, s = volume.size;
            box.transform.SetPositionAndRotation(new Vector3(p[0], p[1], p[2]), new Quaternion(q[0], q[1], q[2], q[3]));
            box.transform.localScale = new Vector3(s[0], s[1], s[2]);
        }
    }

    static Texture3D Texture(HemibakeProbes.Volume volume, int number)
    {
        int[] size = volume.resolution;
        var texture = new Texture3D(size[0], size[1], size[2], TextureFormat.RGBAHalf, false)
        {
            wrapMode = TextureWrapMode.Clamp, filterMode = FilterMode.Bilinear
        };
        texture.SetPixelData(Convert.FromBase64String(volume.textures[number]), 0);
        texture.Apply(false);
        return texture;
    }
}
