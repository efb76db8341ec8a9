# Shows an imported glTF file with its lightmaps, as docs/engines/godot.md describes, and writes the pixels to a file.
extends SceneTree

# The shader of docs/engines/godot.md for Godot 3, plus emission of any brightness, which its importer clips.
const SHADER = """
shader_type spatial;
render_mode ambient_light_disabled;
uniform vec4 color : hint_color = vec4(1.0);
uniform sampler2D lightmap;
uniform vec3 shine = vec3(0.0);
uniform bool directional = false;
uniform sampler2D bumps : hint_normal;
uniform sampler2D l0;
uniform sampler2D l1_x;
uniform sampler2D l1_y;
uniform sampler2D l1_z;
void fragment() {
    ALBEDO = color.rgb;
    SPECULAR = 0.0;
    vec3 light = texture(lightmap, UV2).rgb;
    if (directional) {
        vec2 bump = texture(bumps, UV).rg * 2.0 - 1.0;
        float up = sqrt(max(1.0 - dot(bump, bump), 0.0));
        vec3 n = normalize(bump.x * TANGENT + bump.y * BINORMAL + up * NORMAL);
        vec3 w = (CAMERA_MATRIX * vec4(n, 0.0)).xyz;
        light = max(texture(l0, UV2).rgb + w.x * texture(l1_x, UV2).rgb - w.z * texture(l1_y, UV2).rgb
            + w.y * texture(l1_z, UV2).rgb, 0.0);
    }
    EMISSION = ALBEDO * light + shine;
}
"""

var asked = {}
var textures = {}
var shader = Shader.new()


func _init():
    var file = File.new()
    file.open("res://show.json", File.READ)
    asked = parse_json(file.get_as_text())
    file.close()
    shader.code = SHADER
    show()


func show():
    # A viewport of its own keeps linear colours of any brightness.
    var viewport = Viewport.new()
    viewport.size = Vector2(asked.width, asked.height)
    viewport.own_world = true
    viewport.hdr = true
    viewport.keep_3d_linear = true
    viewport.render_target_update_mode = Viewport.UPDATE_ALWAYS
    get_root().add_child(viewport)
    var scene = load("res://" + asked.file).instance()
    viewport.add_child(scene)
    add_black(viewport)
    light_up(scene)
    for frame in range(6):
        yield(self, "idle_frame")
    var image = viewport.get_texture().get_data()
    image.convert(Image.FORMAT_RGBAF)
    var out = File.new()
    out.open("res://pixels.bin", File.WRITE)
    out.store_buffer(image.get_data())
    out.close()
    quit()


func add_black(viewport):
    var surroundings = WorldEnvironment.new()
    surroundings.environment = Environment.new()
    surroundings.environment.background_mode = Environment.BG_COLOR
    surroundings.environment.background_color = Color(0, 0, 0)
    viewport.add_child(surroundings)


func light_up(node):
    if node is Camera:
        node.current = true
    if node.name in asked.hidden:
        node.visible = false
    if node is MeshInstance and node.name in asked.maps:
        for surface in range(node.mesh.get_surface_count()):
            node.set_surface_material(surface, lit(node.mesh.surface_get_material(surface), asked.maps[node.name]))
    for child in node.get_children():
        light_up(child)


# A material that shows the lightmaps of an object: their files by the names of outputs.
func lit(plain, maps):
    var material = ShaderMaterial.new()
    material.shader = shader
    material.set_shader_param("color", plain.albedo_color)
    material.set_shader_param("lightmap", texture_of(maps["combined"]))
    var shine = asked.shine[plain.resource_name]
    material.set_shader_param("shine", Vector3(shine[0], shine[1], shine[2]))
    if asked.directional and plain.normal_texture != null:
        material.set_shader_param("directional", true)
        material.set_shader_param("bumps", plain.normal_texture)
        for name in ["l0", "l1_x", "l1_y", "l1_z"]:
            material.set_shader_param(name, texture_of(maps[name]))
    return material


func texture_of(file):
    if not file in textures:
        var image = Image.new()
        image.load("res://" + file)
        textures[file] = ImageTexture.new()
        textures[file].create_from_image(image, Texture.FLAG_FILTER)
    return textures[file]
