#pragma once

// All that the installed package offers: upload, tiles, localisation, and the map's upkeep.
#include "client/mapkeep/client.h"
#include "client/mapkeep/scan_checksums.h"
#include "client/mapkeep/tile_folder.h"
