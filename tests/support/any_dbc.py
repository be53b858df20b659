"""A database with a bit of everything: both byte orders, floats, pages, start values, an event, a long message."""

TEXT = """VERSION ""
BU_: ABS PCM
BO_ 100 MIXED: 8 ABS
 SG_ LITTLE : 4|9@1- (0.5,-3) [0|0] "m" PCM
 SG_ BIG : 23|12@0+ (0.01,-67.67) [0|0] "km/h" PCM
 SG_ BIG_SIGNED : 34|7@0- (1,0) [0|0] "" PCM
 SG_ TAIL : 48|16@1+ (0.1,0) [0|0] "" PCM
BO_ 101 FLOATS: 8 ABS
 SG_ F_LITTLE : 0|32@1- (1,0) [0|0] "" PCM
 SG_ F_BIG : 39|32@0- (2,1) [0|0] "" PCM
BO_ 2147484000 MUXED: 8 PCM
 SG_ PAGE M : 0|4@1+ (1,0) [0|0] "" ABS
 SG_ ALWAYS : 4|4@1+ (1,0) [0|0] "" ABS
 SG_ ON_1 m1 : 8|16@1+ (0.01,0) [0|0] "" ABS
 SG_ ON_2 m2 : 8|16@1- (1,0) [0|0] "" ABS
BO_ 102 COUNTED: 8 ABS
 SG_ SUM : 7|8@0+ (1,0) [0|0] "" PCM
 SG_ COUNTER : 8|4@1+ (1,0) [0|0] "" PCM
 SG_ STATE : 12|3@1+ (1,0) [0|0] "" PCM
BO_ 103 EVENT: 2 ABS
 SG_ DOOR : 0|2@1+ (1,0) [0|0] "" PCM
BO_ 104 LONG: 64 ABS
 SG_ FAR : 500|2@1+ (1,0) [0|0] "" PCM
BA_DEF_ SG_ "GenSigStartValue" INT -100000 100000;
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenSigStartValue" 0;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "GenSigStartValue" SG_ 100 BIG 3000;
BA_ "GenSigStartValue" SG_ 100 LITTLE -5;
BA_ "GenSigStartValue" SG_ 102 STATE 5;
BA_ "GenSigStartValue" SG_ 2147484000 PAGE 2;
BA_ "GenSigStartValue" SG_ 2147484000 ON_2 -7;
BA_ "GenMsgCycleTime" BO_ 100 10;
BA_ "GenMsgCycleTime" BO_ 101 20;
BA_ "GenMsgCycleTime" BO_ 102 25;
BA_ "GenMsgCycleTime" BO_ 2147484000 100;
SIG_VALTYPE_ 101 F_LITTLE : 1;
SIG_VALTYPE_ 101 F_BIG : 1;
VAL_ 102 STATE 0 "OFF" 5 "READY" ;
"""
