"""Many tasks on several processes or on a cluster: what sweeps, the withheld check and the protocol
run on."""
