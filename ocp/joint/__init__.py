"""Problems of a joint on tendons: its exact inverse and its forward simulation."""
