@tool
extends LightmapGI
## Lightmaps of one size. Builds its data when the scene is loaded, from images and from metadata of
## meshes.

## Metadata of a mesh: slice and size of its lightmap.
const SLICE := "hemibake_slice"
const SIZE := "hemibake_size"

## Images of light, E / pi, all of the same size.
@export var maps: Array[Image] = []


func _ready() -> void:
	if maps.is_empty():
		return
	var texture := Texture2DArray.new()
	texture.create_from_images(maps)
	var data := LightmapGIData.new()
	data.lightmap_textures = [texture] as Array[TextureLayered]
	var box := AABB()
	var size := maps[0].get_size()
	for mesh: MeshInstance3D in get_parent().find_children("*", "MeshInstance3D", true, false):
		if mesh.get_meta(SIZE, Vector2i.ZERO) != size:
			continue
		data.add_user(get_path_to(mesh), Rect2(0, 0, 1, 1), int(mesh.get_meta(SLICE)), -1)
		var own := global_transform.affine_inverse() * mesh.global_transform * mesh.get_aabb()
		box = own if box == AABB() else box.merge(own)
	(
		data
		. _set_probe_data(
			{
				"bounds": box,
				"points": PackedVector3Array(),
				"tetrahedra": PackedInt32Array(),
				"bsp": PackedInt32Array(),
				"sh": PackedColorArray(),
				"interior": false,
				"baked_exposure": 1.0,
			}
		)
	)
	light_data = data
