"""An adaptive search for starts and sizes of disturbances at which a promoted candidate fails."""
