"""Message classes of packages that have no wheel, for publishers and subscribers of raw messages.

The name of a type on the wire is its own; what converts fields is left out, since raw messages are bytes.
Structures are those of rosidl (message_type_support_struct.h) and of rosidl_typesupport_fastrtps_c.
"""

import ctypes

from geometry_msgs.msg import TransformStamped

_KNOWN = type(TransformStamped)
_KNOWN.__import_type_support__()
_CONVERTERS = ("_CREATE_ROS_MESSAGE", "_CONVERT_FROM_PY", "_CONVERT_TO_PY", "_DESTROY_ROS_MESSAGE")
_HANDLE_FIELDS, _CALLBACK_FIELDS = 6, 7
_FASTRTPS = b"rosidl_typesupport_fastrtps_c"
_kept = []

_find_handle = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_char_p)
_pointer_of = ctypes.pythonapi.PyCapsule_GetPointer
_pointer_of.restype, _pointer_of.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
_capsule_of = ctypes.pythonapi.PyCapsule_New
_capsule_of.restype = ctypes.py_object
_capsule_of.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]


def message_class(package, name):
    """The class of `package/msg/name`; only for raw messages."""
    known = (ctypes.c_void_p * _HANDLE_FIELDS).from_address(_pointer_of(_KNOWN._TYPE_SUPPORT, None))
    fast_at = _find_handle(known[2])(ctypes.addressof(known), _FASTRTPS)
    handle = (ctypes.c_void_p * _HANDLE_FIELDS)(*(ctypes.c_void_p * _HANDLE_FIELDS).from_address(fast_at))
    callbacks = (ctypes.c_void_p * _CALLBACK_FIELDS).from_address(handle[1])
    texts = [ctypes.create_string_buffer(text.encode()) for text in (f"{package}::msg", name)]
    own = (ctypes.c_void_p * _CALLBACK_FIELDS)(*callbacks)
    own[0], own[1] = (ctypes.addressof(text) for text in texts)
    handle[1] = ctypes.addressof(own)
    _kept.extend((handle, own, *texts))
    support = _capsule_of(ctypes.addressof(handle), None, None)
    members = {member: getattr(_KNOWN, member) for member in _CONVERTERS}
    kind = type(f"Metaclass_{name}", (type,), {"_TYPE_SUPPORT": support, **members})
    return kind(name, (), {"__module__": f"{package}.msg"})
