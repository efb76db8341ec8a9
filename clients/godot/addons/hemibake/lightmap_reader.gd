@tool
extends GLTFDocumentExtension
## Reads the lightmaps of a glTF file: those in the file (MOZ_lightmap), else those of hemibake.json
## beside it.
##
## The imported scene holds the images, so the file can be moved and imported again. Nodes are found
## by metadata, because Godot renames them after import.

const Lightmap := preload("hemibake_lightmap.gd")
const MANIFEST := "hemibake.json"
const RADIANCE := "image/vnd.radiance"

## Temporary file from which Godot decodes an image in Radiance format.
const TEMPORARY := "user://hemibake_lightmap.hdr"


func _import_preflight(state: GLTFState, extensions: PackedStringArray) -> Error:
	if "MOZ_lightmap" in extensions or not _entries(state).is_empty():
		return OK
	return ERR_SKIP


func _get_supported_extensions() -> PackedStringArray:
	return ["MOZ_lightmap", "MOZ_texture_rgbe"]


func _parse_texture_json(_state: GLTFState, json: Dictionary, texture: GLTFTexture) -> Error:
	var rgbe: Dictionary = json.get("extensions", {}).get("MOZ_texture_rgbe", {})
	if rgbe.has("source"):
		texture.src_image = int(rgbe.source)
	return OK


func _parse_image_data(
	_state: GLTFState, _data: PackedByteArray, mime: String, image: Image
) -> Error:
	# Godot's importer stops at images that it cannot read. Lightmaps are read at the end.
	if mime == RADIANCE:
		image.copy_from(Image.create_empty(1, 1, false, Image.FORMAT_RGB8))
	return OK


func _import_post(state: GLTFState, root: Node) -> Error:
	var shown := _maps_in_file(state)
	if shown.is_empty():
		shown = _maps_beside(state)
	var images := {}
	for index: int in shown:
		var map: Dictionary = shown[index]
		if not images.has(map.key):
			images[map.key] = _image(state, map)
	var groups := {}
	for index: int in shown:
		var image: Image = images[shown[index].key]
		var node := state.get_scene_node(index)
		if image != null and node != null:
			_add(groups, image, node)
	for group: Node in groups.values():
		root.add_child(group, true)
		group.owner = root
	return OK


## Puts a node into the LightmapGI for lightmaps of this size.
func _add(groups: Dictionary, image: Image, node: Node) -> void:
	var size := image.get_size()
	if not groups.has(size):
		var made := LightmapGI.new()
		made.set_script(Lightmap)
		made.name = (
			"Lightmap %d" % size.x if size.x == size.y else "Lightmap %dx%d" % [size.x, size.y]
		)
		groups[size] = made
	var group: LightmapGI = groups[size]
	var slice: int = group.maps.find(image)
	if slice < 0:
		slice = group.maps.size()
		group.maps.append(image)
	node.set_meta(Lightmap.SLICE, slice)
	node.set_meta(Lightmap.SIZE, size)


## Returns the lightmap of each node by its index: key, image of the file, and factor of its texels.
func _maps_in_file(state: GLTFState) -> Dictionary:
	var json := state.json
	var found := {}
	var nodes: Array = json.get("nodes", [])
	for index in nodes.size():
		if not nodes[index].has("mesh"):
			continue
		for primitive: Dictionary in json.meshes[int(nodes[index].mesh)].primitives:
			if not primitive.has("material"):
				continue
			var material: Dictionary = json.materials[int(primitive.material)]
			var lightmap: Dictionary = material.get("extensions", {}).get("MOZ_lightmap", {})
			if lightmap.is_empty():
				continue
			var texture: Dictionary = json.textures[int(lightmap.index)]
			var rgbe: Dictionary = texture.get("extensions", {}).get("MOZ_texture_rgbe", {})
			var source := int(rgbe.get("source", texture.get("source", -1)))
			found[index] = {
				"key": source, "image": source, "factor": float(lightmap.get("intensity", 1.0)) / PI
			}
	return found


## Returns the lightmap of each node by its index: key and file.
func _maps_beside(state: GLTFState) -> Dictionary:
	var files := {}
	var entries := _entries(state)
	for file: String in entries:
		for object: Dictionary in entries[file].objects:
			if files.get(object.object, file) != file:
				push_warning(
					(
						"%s: instances of '%s' are in several lightmaps. Export with HDR in the file."
						% [state.filename, object.object]
					)
				)
			files[object.object] = file
	var found := {}
	var nodes: Array = state.json.get("nodes", [])
	for index in nodes.size():
		var file: String = files.get(nodes[index].get("name", ""), "")
		if nodes[index].has("mesh") and file != "":
			found[index] = {"key": file, "file": file}
	return found


## Returns the lightmaps of this glTF file in the manifest beside it, by file name.
func _entries(state: GLTFState) -> Dictionary:
	var path := state.base_path.path_join(MANIFEST)
	if not FileAccess.file_exists(path):
		return {}
	var manifest = JSON.parse_string(FileAccess.get_file_as_string(path))
	if manifest is not Dictionary or manifest.get("version") != 2:
		push_error(
			"%s: not a manifest of version 2. Export again with this version of Hemibake." % path
		)
		return {}
	var found := {}
	for file: String in manifest.lightmaps:
		var entry: Dictionary = manifest.lightmaps[file]
		var exported: String = entry.get("export", "")
		if exported.get_basename() == state.filename and entry.get("output") == "combined":
			found[file] = entry
	return found


## Returns the light of a lightmap in half floats; null with an error message if it cannot be read.
func _image(state: GLTFState, map: Dictionary) -> Image:
	var image := _decoded(state, map)
	if image == null or image.is_empty():
		push_error("%s: the lightmap %s cannot be read. Export again." % [state.filename, map.key])
		return null
	image.convert(Image.FORMAT_RGBF)
	var factor: float = map.get("factor", 1.0)
	if not is_equal_approx(factor, 1.0):
		for y in image.get_height():
			for x in image.get_width():
				image.set_pixel(x, y, image.get_pixel(x, y) * factor)
	image.convert(Image.FORMAT_RGBH)
	return image


func _decoded(state: GLTFState, map: Dictionary) -> Image:
	if map.has("file"):
		return Image.load_from_file(state.base_path.path_join(map.file))
	var json: Dictionary = state.json.images[map.image]
	var data := _bytes(state, json)
	if json.get("mimeType") == RADIANCE:
		var file := FileAccess.open(TEMPORARY, FileAccess.WRITE)
		file.store_buffer(data)
		file.close()
		var image := Image.load_from_file(TEMPORARY)
		DirAccess.remove_absolute(TEMPORARY)
		return image
	var picture := Image.new()
	return picture if picture.load_png_from_buffer(data) == OK else null


func _bytes(state: GLTFState, json: Dictionary) -> PackedByteArray:
	if json.has("uri"):
		return FileAccess.get_file_as_bytes(
			state.base_path.path_join(String(json.uri).uri_decode())
		)
	var view: Dictionary = state.json.bufferViews[int(json.bufferView)]
	var start := int(view.get("byteOffset", 0))
	return state.buffers[int(view.get("buffer", 0))].slice(start, start + int(view.byteLength))
