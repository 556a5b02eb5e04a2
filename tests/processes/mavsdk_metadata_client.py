"""A MAVSDK program that downloads the parameters' metadata and prints the JSON."""

import asyncio
import sys

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.component_metadata import ComponentMetadataAsync
from mavsdk.plugins.component_metadata import MetadataType

TIMEOUT_S = 30.0


async def fetch(address: str) -> str:
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    await mavsdk.add_any_connection(address)
    system = await mavsdk.first_autopilot(timeout_s=TIMEOUT_S)
    metadata = ComponentMetadataAsync(system)
    updates = metadata.subscribe_metadata_available()
    waiting = asyncio.ensure_future(anext(updates))
    await asyncio.sleep(0.1)
    await metadata.request_autopilot_component()
    update = await asyncio.wait_for(waiting, TIMEOUT_S)
    while update.type != MetadataType.PARAMETER:
        update = await asyncio.wait_for(anext(updates), TIMEOUT_S)
    return str((await metadata.get_metadata(1, MetadataType.PARAMETER)).json_metadata)


print(asyncio.run(fetch(sys.argv[1])))
