# Decodes texture.ktx2 of the project to texels.bin: float32 RGBA of all mip levels, largest first,
# top row first.
extends SceneTree


func _init() -> void:
	var image := Image.new()
	var error := image.load_ktx_from_buffer(FileAccess.get_file_as_bytes("res://texture.ktx2"))
	if error == OK:
		image.convert(Image.FORMAT_RGBAF)
		FileAccess.open("res://texels.bin", FileAccess.WRITE).store_buffer(image.get_data())
	print("KTX2: error %d, %d x %d" % [error, image.get_width(), image.get_height()])
	quit()
