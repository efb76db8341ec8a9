# Opens an exported scene in Godot 4 and writes the pixels that its camera sees to a file.
extends SceneTree

const FRAMES := 8

var asked: Dictionary
var moved: GeometryInstance3D


func _init() -> void:
	asked = JSON.parse_string(FileAccess.get_file_as_string("res://show.json"))
	show()


func show() -> void:
	# A viewport of its own keeps linear colours of any brightness.
	var viewport := SubViewport.new()
	viewport.size = Vector2i(int(asked.width), int(asked.height))
	viewport.own_world_3d = true
	viewport.use_hdr_2d = true
	viewport.render_target_update_mode = SubViewport.UPDATE_ALWAYS
	root.add_child(viewport)
	var packed: PackedScene = load("res://" + asked.file)
	if packed == null:
		quit(1)
		return
	var scene := packed.instantiate()
	viewport.add_child(scene)
	set_up(scene)
	if scene.find_children("*", "WorldEnvironment", true, false).is_empty():
		viewport.add_child(black())
	if asked.has("sun"):
		viewport.add_child(sun(asked.sun))
	var out := FileAccess.open("res://pixels.bin", FileAccess.WRITE)
	if moved == null:
		await draw(viewport, out)
	else:
		# Global transforms of nodes are known once they are inside the tree.
		await process_frame
		for place in asked.places:
			moved.global_position = Vector3(place[0], place[1], place[2])
			await draw(viewport, out)
	out.close()
	quit()


# Adds the pixels of a viewport to a file.
func draw(viewport: SubViewport, out: FileAccess) -> void:
	for frame in FRAMES:
		await process_frame
	var image := viewport.get_texture().get_image()
	image.convert(Image.FORMAT_RGBAF)
	for y in image.get_height():
		for x in image.get_width():
			image.set_pixel(x, y, image.get_pixel(x, y).srgb_to_linear())
	out.store_buffer(image.get_data())


func set_up(node: Node) -> void:
	if node is Camera3D:
		node.current = true
	if node is GeometryInstance3D and asked.get("moved", "") == String(node.name):
		node.gi_mode = GeometryInstance3D.GI_MODE_DYNAMIC
		moved = node
	if node is Node3D and String(node.name) in asked.hidden:
		node.visible = false
	if node is WorldEnvironment and asked.has("background"):
		set_background(node.environment, asked.background)
	if node is LightmapGI and asked.has("data"):
		node.light_data = load("res://" + asked.data.replace("NODE", node.name))
	for child in node.get_children():
		set_up(child)


# Shows a radiance where nothing is drawn, which lights nothing.
func set_background(environment: Environment, radiance: Array) -> void:
	environment.background_mode = Environment.BG_COLOR
	environment.background_color = Color(radiance[0], radiance[1], radiance[2]).linear_to_srgb()
	environment.ambient_light_source = Environment.AMBIENT_SOURCE_DISABLED
	environment.reflected_light_source = Environment.REFLECTION_SOURCE_DISABLED


func black() -> WorldEnvironment:
	var surroundings := WorldEnvironment.new()
	surroundings.environment = Environment.new()
	surroundings.environment.background_mode = Environment.BG_COLOR
	surroundings.environment.background_color = Color.BLACK
	return surroundings


# A sun whose shadows come from shadow masks only: its irradiance / pi, and the direction of its
# light.
func sun(kind: Dictionary) -> DirectionalLight3D:
	var light := DirectionalLight3D.new()
	light.light_energy = kind.energy
	light.light_specular = 0.0
	light.shadow_enabled = true
	light.directional_shadow_max_distance = 0.001
	light.directional_shadow_fade_start = 0.0
	var d: Array = kind.direction
	light.look_at_from_position(Vector3.ZERO, Vector3(d[0], d[1], d[2]), Vector3.RIGHT)
	return light
