"""What goes wrong on board and when: scenarios and ground stations order it, the plant suffers it.

``catalogue`` says what can fail and how, ``timeline`` when; ``body``, ``tail`` and ``readings`` do
it to the vehicle, to what drives her and to what her instruments say; ``orders`` speaks
MAV_CMD_INJECT_FAILURE."""
