"""A run as a rosbag2: a folder with an MCAP file and ``metadata.yaml``, as ``ros2 bag record -s mcap`` writes it.

rosbags is imported only where a bag is written.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from wayfarer.fieldlog.reader import Damage, RunReader
from wayfarer.views.export.ros_messages import TF_STATIC, TOPICS, RosMessages
from wayfarer.views.export.run_metadata import run_metadata
from wayfarer.views.export.wall_time import nanoseconds, read_clock_zero_s

VERSION: Final = 8  # of the metadata: ROS 2 Iron writes it, and later ones read it
NO_LIMIT = QosTime(9223372036, 854775807)  # ROS 2's infinite time
# As tf2 publishes and subscribes to static transforms: who plays the bag later gets them too.
LATCHED = Qos(
    QosHistory.KEEP_LAST, 1, QosReliability.RELIABLE, QosDurability.TRANSIENT_LOCAL, NO_LIMIT, NO_LIMIT,
    QosLiveliness.AUTOMATIC, NO_LIMIT, avoid_ros_namespace_conventions=False,
)  # fmt: skip


def write_rosbag2(run: Path, bag: Path) -> Damage:
    """Write a run as a bag into a folder that is made here, and return what of the log could not be read.

    The same log gives the same bytes.

    Raises:
        BadInput: the run cannot be read.
        OSError: the folder cannot be written.
    """
    reader = RunReader(run)
    messages = RosMessages(read_clock_zero_s(reader))
    types = get_typestore(Stores.ROS2_HUMBLE)
    writer = Writer(bag, version=VERSION, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        connections = {
            topic: writer.add_connection(
                topic,
                kind.__msgtype__,
                typestore=types,
                offered_qos_profiles=[LATCHED] if topic == TF_STATIC else [],
            )
            for topic, kind in TOPICS.items()
        }
        for record in RunReader(run):
            for topic, time_s, message in messages.take(record):
                data = types.serialize_cdr(message, TOPICS[topic].__msgtype__)
                writer.write(connections[topic], nanoseconds(time_s), data)
        for key, value in run_metadata(messages.header).items():
            writer.set_custom_data(key, value)
    return reader.damage
