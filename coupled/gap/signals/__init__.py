"""What a record holds of each stage: its inputs and outputs, and their floors."""
