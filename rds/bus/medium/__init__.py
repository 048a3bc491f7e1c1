"""The medium: frames on the wire bit by bit, arbitration, disturbances, and the confinement of faulty controllers."""
