// Not run: see README.md. Lights moving objects by the light probes that Hemibake has exported.
using System;
using UnityEngine;
using UnityEngine.Rendering;

/// <summary>Gives renderers the light at their place, interpolated between probes. Belongs on the model's root.</summary>
[ExecuteAlways]
public sealed class HemibakeProbes : MonoBehaviour
{
    const int Coefficients = 9, Numbers = 27;

    /// <summary>A grid of probes, as in the file; lists have no names of axes.</summary>
    [Serializable]
    public sealed class Volume
    {
        public string name;
        public int[] resolution;
        public float[] worldToLocal, position, rotation, size;
        public string harmonics;
        public string[] textures;

        [NonSerialized] public SphericalHarmonicsL2[] probes;

        /// <summary>Returns a point of the model in the box from -1/2 to 1/2.</summary>
        public Vector3 Local(Vector3 point)
        {
            float[] m = worldToLocal;
            float Row(int i) => m[i] * point.x + m[i + 1] * point.y + m[i + 2] * point.z + m[i + 3];
            return new Vector3(Row(0), Row(4), Row(8));
        }

        /// <summary>Volume of a cell in units of the model: smaller cells are more exact.</summary>
        public float CellSize
        {
            get
            {
                float[] m = worldToLocal;
                var x = new Vector3(m[0], m[1], m[2]);
                var y = new Vector3(m[4], m[5], m[6]);
                var z = new Vector3(m[8], m[9], m[10]);
                float toLocal = Mathf.Abs(Vector3.Dot(Vector3.Cross(x, y), z));
                return 1 / (toLocal * resolution[0] * resolution[1] * resolution[2]);
            }
        }

        /// <summary>Returns the light at a place of the box; outside of it that of the border.</summary>
        public SphericalHarmonicsL2 Sample(Vector3 local)
        {
            var low = new int[3];
            var high = new int[3];
            var part = new float[3];
            for (int axis = 0; axis < 3; axis++)
            {
                float place = Mathf.Clamp((local[axis] + 0.5f) * resolution[axis] - 0.5f, 0, resolution[axis] - 1);
                low[axis] = Mathf.FloorToInt(place);
                high[axis] = Mathf.Min(low[axis] + 1, resolution[axis] - 1);
                part[axis] = place - low[axis];
            }
            var sum = new SphericalHarmonicsL2();
            for (int corner = 0; corner < 8; corner++)
            {
                float weight = 1;
                int index = 0, stride = 1;
                for (int axis = 0; axis < 3; axis++)
                {
                    bool isHigh = (corner >> axis & 1) == 1;
                    weight *= isHigh ? part[axis] : 1 - part[axis];
                    index += stride * (isHigh ? high[axis] : low[axis]);
                    stride *= resolution[axis];
                }
                sum += probes[index] * weight;
            }
            return sum;
        }
    }

    [Serializable]
    sealed class Contents
    {
        public Volume[] volumes;
    }

    /// <summary>File that the export writes beside the model, such as room.Probes.json.</summary>
    public TextAsset file;

    /// <summary>Renderers that move.</summary>
    public Renderer[] lit = Array.Empty<Renderer>();

    readonly SphericalHarmonicsL2[] shown = new SphericalHarmonicsL2[1];
    Volume[] volumes = Array.Empty<Volume>();
    MaterialPropertyBlock block;

    void OnEnable()
    {
        block = new MaterialPropertyBlock();
        volumes = file == null ? Array.Empty<Volume>() : Read(file.text);
    }

    void OnDisable()
    {
        foreach (var renderer in lit)
        {
            if (renderer == null)
                continue;
            renderer.SetPropertyBlock(null);
            renderer.lightProbeUsage = LightProbeUsage.BlendProbes;
        }
    }

    void LateUpdate()
    {
        if (volumes.Length == 0)
            return;
        foreach (var renderer in lit)
        {
            if (renderer == null)
                continue;
            shown[0] = At(renderer.bounds.center);
            renderer.lightProbeUsage = LightProbeUsage.CustomProvided;
            renderer.GetPropertyBlock(block);
            block.CopySHCoefficientArraysFrom(shown);
            renderer.SetPropertyBlock(block);
        }
    }

    /// <summary>Returns the light at a point of the world: of the volume with the smallest cells around it.</summary>
    public SphericalHarmonicsL2 At(Vector3 point)
    {
        Vector3 place = transform.InverseTransformPoint(point);
        Volume inner = null, coarsest = volumes[0];
        foreach (var volume in volumes)
        {
            Vector3 local = volume.Local(place);
            bool isInside = Mathf.Max(Mathf.Abs(local.x), Mathf.Abs(local.y), Mathf.Abs(local.z)) <= 0.5f;
            if (isInside && (inner == null || volume.CellSize < inner.CellSize))
                inner = volume;
            if (volume.CellSize > coarsest.CellSize)
                coarsest = volume;
        }
        Volume used = inner ?? coarsest;
        return used.Sample(used.Local(place));
    }

    /// <summary>Returns the volumes of a file.</summary>
    public static Volume[] Read(string json)
    {
        var found = JsonUtility.FromJson<Contents>(json).volumes;
        foreach (var volume in found)
        {
            byte[] bytes = Convert.FromBase64String(volume.harmonics);
            var numbers = new float[bytes.Length / sizeof(float)];
            Buffer.BlockCopy(bytes, 0, numbers, 0, bytes.Length);
            volume.probes = new SphericalHarmonicsL2[numbers.Length / Numbers];
            for (int i = 0; i < numbers.Length; i++)
                volume.probes[i / Numbers][i % Numbers / Coefficients, i % Coefficients] = numbers[i];
        }
        return found;
    }
}
