# What goes over the bus: the daemon and clients in processes of their own.
pb_bench(bus SOURCES bench_bus.c bus_client.c child.c LIBS plantbus_bus TOOLS plantbusd)
