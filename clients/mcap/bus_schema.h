// The types of the bus as text (idl/plantbus.idl), which recordings carry as their schema.
#ifndef PB_CLIENTS_BUS_SCHEMA_H
#define PB_CLIENTS_BUS_SCHEMA_H

extern const char pb_bus_schema[];

#endif
