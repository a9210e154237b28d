"""What units are built from: pipelines, graphs of operations, queues, layouts."""
