// SPDX-License-Identifier: GPL-3.0-or-later

// Flamenco job type: bakes the lightmaps of a .blend on a farm.
//
//     hall ─┐                        each a Blender that bakes one part into a folder of its own,
//     yard ─┼─ merge                 then one that merges their reports and manifests
//     roof ─┘
//
// Copy this file to the folder "scripts" beside the Flamenco Manager. Hemibake has to be enabled in the Blender
// of every worker, and Flamenco's {blenderArgs} must not hold --factory-startup.

const JOB_TYPE = {
    label: "Hemibake Lightmaps",
    description: "Bake lightmaps, a task for each part of the file, then merge the reports",
    settings: [
        // What to bake.
        { key: "split_by", type: "string", choices: ["file", "scene", "collection", "lightmap"], default: "file",
          description: "What a task bakes: the whole file, a scene, the objects of a collection, or those of a lightmap" },
        { key: "parts", type: "string", required: false,
          eval: "'; '.join(part.name for part in (bpy.data.scenes if settings.split_by == 'scene' else " +
                "C.scene.collection.children if settings.split_by == 'collection' else " +
                "C.scene.hemibake.lightmaps if settings.split_by == 'lightmap' else ()))",
          evalInfo: { showLinkButton: true, description: "All scenes, collections or lightmaps of this file" },
          description: "Names of the parts, with '; ' between them. Not used for a whole file" },
        { key: "hemibake_args", type: "string", required: false,
          description: "Options of `blender -c hemibake`, such as: --quality high --resolution 2048" },

        // Where to.
        { key: "output_root", type: "string", subtype: "dir_path", required: true, visible: "submission",
          description: "Folder that all workers can write to" },
        { key: "output_path", type: "string", subtype: "dir_path", editable: false,
          eval: "str(Path(abspath(settings.output_root), jobname, '{timestamp}'))",
          description: "Folder that receives a folder for each part, the merged report and the merged manifest" },

        // Found by itself.
        { key: "blendfile", type: "string", required: true, visible: "web", description: "Path of the .blend" },
        { key: "scene", type: "string", required: true, eval: "C.scene.name", visible: "web",
          description: "Scene whose collections or lightmaps are baked" },
    ]
};

// The option of `blender -c hemibake` that names a part.
const OPTIONS = { scene: "--scene-name", collection: "--collection", lightmap: "--lightmap" };

function compileJob(job) {
    const settings = job.settings;
    settings.output_path = settings.output_path.replace("{timestamp}", formatTimestampLocal(job.created));

    // Parts do not wait for each other; the merge waits for all.
    const folders = folderNames(partNames(settings));
    const merge = mergeTask(settings, Object.values(folders));
    for (const [part, folder] of Object.entries(folders)) {
        const bake = bakeTask(settings, part, folder);
        job.addTask(bake);
        merge.addDependency(bake);
    }
    job.addTask(merge);
}

// Return the names of the parts, or the name of the file without its ending.
function partNames(settings) {
    if (settings.split_by === "file") {
        return [path.stem(settings.blendfile)];
    }
    const names = (settings.parts || "").split(";").map(name => name.trim()).filter(name => name);
    if (!names.length) {
        throw `Name at least one ${settings.split_by} in "parts", or split by "file".`;
    }
    return [...new Set(names)];
}

// Return a folder for each part: its name without what file systems refuse, numbered where two become the same.
function folderNames(parts) {
    const folders = {}, taken = new Set();
    for (const part of parts) {
        const base = part.replace(/[\\/:*?"<>|\s]+/g, "_").replace(/^\.+/, "_");
        let folder = base;
        for (let number = 2; taken.has(folder.toLowerCase()); number++) {
            folder = `${base}-${number}`;
        }
        taken.add(folder.toLowerCase());
        folders[part] = folder;
    }
    return folders;
}

// Return the task that bakes a part into its folder.
function bakeTask(settings, part, folder) {
    const out = path.join(settings.output_path, folder);
    const task = author.Task(`bake-${part}`, "blender");
    task.addCommand(hemibake("hemibake", settings.blendfile, [
        "--out", out,
        "--report", path.join(out, "report.json"),
        ...partOptions(settings, part),
        ...shellSplit(settings.hemibake_args || ""),
    ]));
    return task;
}

// Return the options that choose a part; collections and lightmaps are those of the scene that was submitted.
function partOptions(settings, part) {
    switch (settings.split_by) {
    case "file":
        return [];
    case "scene":
        return [OPTIONS.scene, part];
    default:
        return [OPTIONS.scene, settings.scene, OPTIONS[settings.split_by], part];
    }
}

// Return the task that merges the reports of all parts. It needs no .blend, but workers before 3.5 want one to be named.
function mergeTask(settings, folders) {
    const task = author.Task("merge", "blender");
    task.addCommand(hemibake("hemibake_merge", settings.blendfile, [settings.output_path, "--parts", ...folders]));
    return task;
}

// Return the command that runs one of Hemibake's in Blender.
function hemibake(name, blendfile, args) {
    return author.Command("blender-render", {
        exe: "{blender}",
        exeArgs: "{blenderArgs}",
        argsBefore: [],
        blendfile: blendfile,
        args: ["--command", name, ...args],
    }, 1);
}
