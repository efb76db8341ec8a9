@tool
extends EditorPlugin
## Registers the reader of lightmaps with Godot's glTF importer.

const Reader := preload("lightmap_reader.gd")

var _reader: GLTFDocumentExtension = Reader.new()


func _enter_tree() -> void:
	GLTFDocument.register_gltf_document_extension(_reader)


func _exit_tree() -> void:
	GLTFDocument.unregister_gltf_document_extension(_reader)
