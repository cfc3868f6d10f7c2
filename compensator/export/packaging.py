"""What carries the exported C into other tools: manifests, a ROS 2 controller, Structured Text, a calibration file."""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Packed:
    """One file beside the C."""

    path: str  # below the exported folder; {p} is the prefix
    template: str  # in `templates`
    needs: str = ""  # module without which there is no such file; "follower" for any that follows a reference


_EVERY = (
    Packed(path="{p}_parameters.a2l", template="c/parameters.a2l.j2"),
    Packed(path="zephyr/module.yml", template="packages/zephyr_module.yml.j2"),
    Packed(path="zephyr/CMakeLists.txt", template="packages/zephyr_cmake.txt.j2"),
    Packed(path="zephyr/Kconfig", template="packages/zephyr_kconfig.j2"),
    Packed(path="library.json", template="packages/library.json.j2"),
    Packed(path="library.properties", template="packages/library.properties.j2"),
    Packed(path="structured_text/{p}_capstan.st", template="packages/capstan.st.j2", needs="capstan"),
    Packed(path="structured_text/{p}_table.st", template="packages/table.st.j2", needs="table"),
    Packed(path="ros2/{p}_controller/package.xml", template="packages/ros2_package.xml.j2", needs="follower"),
    Packed(path="ros2/{p}_controller/CMakeLists.txt", template="packages/ros2_cmake.txt.j2", needs="follower"),
    Packed(path="ros2/{p}_controller/{p}_controller.xml", template="packages/ros2_plugin.xml.j2", needs="follower"),
    Packed(path="ros2/{p}_controller/{p}_controller.cpp", template="packages/ros2_controller.cpp.j2", needs="follower"),
)


def packed(modules: Sequence[str], follower: str, prefix: str) -> dict[str, str]:
    """Template of each file, by its path below the exported folder; `follower` is what a controller wraps, or empty."""
    there = {"", *modules, *(("follower",) if follower else ())}
    return {each.path.format(p=prefix): each.template for each in _EVERY if each.needs in there}
